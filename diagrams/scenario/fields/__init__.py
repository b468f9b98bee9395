"""The fields of a scenario: their list, similar names, and faults."""
