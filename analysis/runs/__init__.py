"""Evaluates a run: metrics, pictures, replay, and files."""
