"""Decides when Ctrl-C and SIGTERM stop the work of a command."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Handler of interrupts, which are Ctrl-C and SIGTERM.

    The first interrupt has no effect until the next call of ``check``, because
    libraries misbehave if an exception is raised while they load, or in their
    callbacks. A second interrupt raises ``KeyboardInterrupt`` at once.

    Args:
        last: Whether the process ends with the command. If so, interrupts are ignored
            after the command, so that they do not disturb the shutdown of Python.
    """

    def __init__(self, *, last: bool = False) -> None:
        self._last = last
        self._waits = True
        self.struck = False
        """Whether there was an interrupt since the last call of ``forget``."""

    def __enter__(self) -> Interrupts:
        self._before = {each: signal.signal(each, self._strike) for each in _SIGNALS}
        return self

    def __exit__(self, *exception: object) -> None:
        for each, handler in self._before.items():
            signal.signal(each, signal.SIG_IGN if self._last else handler)

    def _strike(self, *_: object) -> None:
        again, self.struck = self.struck, True
        if again or not self._waits:
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raises ``KeyboardInterrupt`` if there was an interrupt."""
        if self.struck:
            raise KeyboardInterrupt

    def forget(self) -> None:
        """Forgets the last interrupt, because the command treats it as a normal end."""
        self.struck = False

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Lets even the first interrupt stop the work anywhere in the ``with`` block.

        Raises:
            KeyboardInterrupt: There was an interrupt before or within the block.
        """
        self._waits = False
        try:
            self.check()
            yield
        finally:
            self._waits = True
