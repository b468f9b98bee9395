"""Draws a run: pictures, films, replays, ROS 2 messages, and block diagrams."""
