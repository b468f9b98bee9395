"""Blocks of each kind of robot: that follows a sound, drives on a route, searches."""
