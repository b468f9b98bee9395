"""What the model costs, compared within one run."""
