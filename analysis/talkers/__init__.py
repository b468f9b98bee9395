"""Several talkers at once: simulated recordings, and what is found in them."""
