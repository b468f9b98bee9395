"""The scenario: its fields, its files, its checks and its warnings."""
