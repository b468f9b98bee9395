"""Radio: frames, the air between robots, and who listens."""
