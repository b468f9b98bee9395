"""What a replay has beside its scene: legend, switches, clock, curves over time."""
