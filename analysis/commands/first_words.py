"""What a command says before it loads what simulates, which takes seconds."""

from __future__ import annotations

import sys


def say(text: str) -> None:
    """Tells a terminal what begins; a pipe gets nothing.

    Args:
        text: As 'simulating default'.
    """
    if sys.stderr.isatty():
        print(f"phonotaxis: {text} ...", file=sys.stderr, flush=True)
