"""Impedance to a target that moves along a route (Engelbrecht et al. 2021)."""
