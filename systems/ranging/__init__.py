"""Range sensors, contact switches, and the detection of obstacles and objects."""
