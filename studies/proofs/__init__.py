"""Regions that are proved to be safe, and bounds on the effect of moving bodies."""
