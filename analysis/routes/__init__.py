"""Stability of robots on routes: frozen gains, adaptation, chains of robots."""
