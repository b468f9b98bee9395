"""What a user must know of a scenario that is run all the same."""
