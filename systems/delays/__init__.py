"""Delays between channels: spectra, correlations, peaks, and errors."""
