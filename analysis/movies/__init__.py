"""A run seen from above as a film, with what its microphones heard."""
