"""Saving what is heard and played in a run, as files of sound."""
