"""The command line: one file a subcommand, and the path that all take."""
