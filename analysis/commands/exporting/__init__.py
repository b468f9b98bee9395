"""Runs for other programs: MCAP, CSV, and what the columns mean."""
