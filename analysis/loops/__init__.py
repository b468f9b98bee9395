"""Models of the control loop: equilibria, linear models, margins, forces of laws."""
