"""Adds legend, switches, clock and curves over time to the 3D scene of a replay."""
