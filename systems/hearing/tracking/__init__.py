"""From fixes to a target: the filter, its model, the block."""
