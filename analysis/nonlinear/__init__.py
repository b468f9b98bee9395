"""Results beyond linear models: velocity terms, oscillations, equilibria, portraits."""
