"""Gathers directions of single times and frequencies into sources and tracks."""
