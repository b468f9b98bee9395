"""Motion straight toward an obstacle, and the places where the robot stops."""
