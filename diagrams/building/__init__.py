"""A scenario becomes a Drake diagram: robots, sources, the world."""
