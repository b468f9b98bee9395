"""What a scenario must have, asked before anything runs."""

__all__: list[str] = []
