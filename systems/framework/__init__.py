"""What every block rests on: parameters, checks, noise, scalars, compiled code."""
