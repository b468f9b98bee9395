"""What the robot knows to be free, and the guard that keeps it there."""
