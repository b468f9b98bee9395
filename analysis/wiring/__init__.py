"""Block diagrams as wires and as pictures."""
