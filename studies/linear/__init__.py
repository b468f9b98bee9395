"""Linear stability over one gain, the sample period, or the silence of the sound."""
