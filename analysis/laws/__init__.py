"""Laws as force over distance: curves, push and pull, the head-on approach."""
