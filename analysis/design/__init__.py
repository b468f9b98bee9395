"""Design of gains from requirements."""
