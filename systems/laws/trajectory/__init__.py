"""Impedance to a target that moves along a planned way (Engelbrecht et al. 2021)."""
