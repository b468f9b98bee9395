"""Builds the Drake diagram of a scenario: robots, sources, and the world."""
