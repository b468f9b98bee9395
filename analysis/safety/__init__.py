"""Attempts to make a guarded robot collide."""
