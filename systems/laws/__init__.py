"""The laws: gains, equations, forces, and one controller per law."""
