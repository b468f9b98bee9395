"""Searches in steps: the olfactory robot, and the robots that hear its call."""
