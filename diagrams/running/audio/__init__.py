"""Saves the sound of a run in files."""
