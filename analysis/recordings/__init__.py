"""Locates sounds in the recordings of microphone arrays."""
