"""Exports runs to other programs, as CSV, Parquet or MCAP files with ROS 2 messages."""
