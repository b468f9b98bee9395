"""Estimates directions, ranges and sources of sounds from microphone arrays."""
