"""Proves for sets of initial states that no collision follows."""
