"""What linear models tell: margins, delay, sampling, bursts, contact, robustness."""
