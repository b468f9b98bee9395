"""Delays between channels: spectra, correlations, peaks, fits, their errors."""
