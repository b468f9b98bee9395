"""Routes through a known map, planned before a run and again when a robot stalls."""
