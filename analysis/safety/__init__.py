"""Searches for runs in which a robot with a guard collides."""
