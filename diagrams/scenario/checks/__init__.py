"""What a scenario must have, asked before anything runs."""
