"""The loop as equations: operating points, linear models, point masses."""
