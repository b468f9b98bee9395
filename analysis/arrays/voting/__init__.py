"""Directions of single times and frequencies, gathered into sources and tracks."""
