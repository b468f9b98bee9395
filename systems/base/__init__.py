"""Bodies with wheels: drive and odometry of the robot, and carrier of the source."""
