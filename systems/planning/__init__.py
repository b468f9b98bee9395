"""Routes, evasion, and velocity filters that use what the robot knows of the floor."""
