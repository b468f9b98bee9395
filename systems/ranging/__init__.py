"""Range sensors, and the collision vector that they give."""
