"""Listens to live sound: streams of samples, their faults, and views of the sources."""
