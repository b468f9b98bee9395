"""Starts from which no collision happens, with proofs."""
