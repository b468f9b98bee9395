"""Computes sets of initial states from which the robot provably never collides."""
