"""What a run did: metrics, pictures, replay, its files."""
