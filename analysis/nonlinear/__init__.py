"""What they do not: velocity terms, oscillations, equilibria, portraits."""
