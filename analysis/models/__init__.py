"""Equations of the control loop: operating points, linear models, point mass."""
