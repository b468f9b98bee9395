"""Searches step by step: the robot that smells, and the robots that hear it."""
