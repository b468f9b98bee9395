"""What fields a scenario has: their list, what is most like a name, faults."""
