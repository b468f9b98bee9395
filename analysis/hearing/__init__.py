"""Measures how well sounds are located: bounds, trials, tables and recordings."""
