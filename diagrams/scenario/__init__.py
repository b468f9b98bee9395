"""The scenario: its fields, files, checks and warnings."""
