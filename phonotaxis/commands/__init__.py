"""The command line: one file for each subcommand, and the code that they share."""
