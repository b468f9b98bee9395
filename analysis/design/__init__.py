"""Gains from requirements."""
