"""Tracking of the source: the filter, its model, the block."""
