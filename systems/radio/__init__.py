"""Radio: frames, the channel between the robots, and the receivers."""
