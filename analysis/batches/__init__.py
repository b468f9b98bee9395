"""Sweeps and comparisons: many runs of variants of a scenario, and their results."""
