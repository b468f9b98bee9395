"""Directions, ranges and sources of sounds from microphone arrays, and their errors."""
