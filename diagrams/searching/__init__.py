"""Robots that search step by step, and what they share."""

__all__: list[str] = []
