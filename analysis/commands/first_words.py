"""A message that a command prints before slow imports, which take seconds."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """Prints a message on standard error if standard error is a terminal.

    Args:
        text: Name of the work that begins, for example 'simulating default'.
    """
    if sys.stderr.isatty():
        print(f"phonotaxis: {text} ...", file=sys.stderr, flush=True)
