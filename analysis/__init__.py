"""Data in, data out: metrics, recordings, pictures of results."""
