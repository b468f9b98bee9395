"""Tries to make a guarded robot collide."""
