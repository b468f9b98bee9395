"""Code that reports share: HTML, tables, plain values, intervals, result directories."""
