"""A diagram runs: Drake's simulator, the compiled loop, the end, the result."""
