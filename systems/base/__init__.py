"""Bodies with wheels: the robot's drive and odometry, and the source's carrier."""
