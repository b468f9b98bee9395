"""The basis of all blocks: parameters, checks, noise, scalars and compiled code."""
