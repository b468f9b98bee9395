"""The laws' curves, and gains from stated requirements."""
