"""A run as one compiled loop over the same blocks that Drake simulates."""
