"""The memory of free space, and the guard that keeps the robot in free space."""
