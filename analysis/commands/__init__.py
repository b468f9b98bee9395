"""The command line: one file a subcommand, and the path that all take.

Nothing but Python's own library is imported on load, so that help and a mistyped
option answer at once.
"""

__all__: list[str] = []
