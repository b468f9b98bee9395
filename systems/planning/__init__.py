"""Paths, evasion and velocity filters that use what a robot knows of the floor."""
