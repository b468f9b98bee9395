"""Checks of a scenario before a run."""
