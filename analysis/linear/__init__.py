"""Results from linear models: margins, delay, sampling, bursts, contact, robustness."""
