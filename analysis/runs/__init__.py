"""What a run did: metrics, pictures, replay, result directories."""
