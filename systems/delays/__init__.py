"""Delays between channels of audio: spectra, correlations, peaks, and errors."""
