"""Comparisons of laws on the same layouts."""
