"""Runs for other programs: what columns mean, CSV, and MCAP of ROS 2 messages."""
