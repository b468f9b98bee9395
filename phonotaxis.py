"""The entry of the command line; ``analysis/commands`` has all the rest."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command.

    Args:
        arguments: Words after the program's name; none: those of the process,
            which has nothing to do afterwards.

    Returns:
        Exit status: 0 done, 2 bad input, 1 anything else.
    """
    try:
        # What loads, loads in here: an interrupt may strike meanwhile.
        from analysis.commands.interrupts import Interrupts

        with Interrupts(last=arguments is None) as interrupts:
            from analysis.commands.command_line import run_words

            words = sys.argv[1:] if arguments is None else arguments
            return run_words(list(words), interrupts)
    except KeyboardInterrupt:
        print("phonotaxis: interrupted; nothing was written", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
