"""Laws as forces over distance: curves, push and pull, and the head-on approach."""
