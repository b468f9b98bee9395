"""Many scenarios, in many processes, into one table."""
