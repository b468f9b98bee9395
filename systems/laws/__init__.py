"""Virtual impedance: attraction, repulsion, a controller a law."""
