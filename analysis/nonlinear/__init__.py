"""Results from nonlinear models: velocity terms, oscillations, equilibria, phases."""
