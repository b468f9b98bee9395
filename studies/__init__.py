"""Investigations whose numbers the documentation quotes."""
