"""The blocks of a diagram and the wires between them, as a drawing."""
