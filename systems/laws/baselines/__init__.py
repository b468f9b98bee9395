"""Baseline laws for comparison: the laws that an engineer would try first."""
