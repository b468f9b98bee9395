"""Sweeps: many runs of variants of a scenario, in many processes, into one table."""
