"""Runs a diagram: Drake's simulator, the compiled loop, stop rules, and results."""
