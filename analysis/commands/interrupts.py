"""Ctrl-C and SIGTERM: when they may stop the work, and how none of them is lost."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
#: If an interrupt had to wait or was swallowed, it is raised again after this time, s.
_AGAIN_S = 0.1


class _Interrupt(KeyboardInterrupt):
    """An interrupt, as a subclass of ``KeyboardInterrupt``.

    Python may evaluate code from a string, for example while Drake is imported. If
    ``KeyboardInterrupt`` itself is raised in this code, Python ends later as if a
    signal had killed the process. That happens even if the exception is caught. A
    subclass avoids the problem.
    """


class Interrupts:
    """Raises a ``KeyboardInterrupt`` when the process receives Ctrl-C or SIGTERM.

    Two cases need special care:

    - While Python loads a C extension, an interrupt would make the extension print text
      and raise other exceptions. The interrupt therefore waits until the extension is
      loaded.
    - Callbacks of compiled code may swallow the exception. The interrupt is therefore
      raised again every 0.1 s until the main program notices it.

    Args:
        last: Whether the process ends with the command. If so, signals are ignored from
            the end of the command on. They then cannot disturb the shutdown of Python.
    """

    def __init__(self, *, last: bool = False) -> None:
        self._last = last
        self._held = True
        self._struck = False

    def __enter__(self) -> Interrupts:
        self._before = {each: signal.signal(each, self._strike) for each in _SIGNALS}
        self._hook, sys.unraisablehook = sys.unraisablehook, self._swallowed
        # Release comes last, because a repeated interrupt needs the alarm's handler.
        self.release()
        return self

    def __exit__(self, *exception: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook = self._hook
        for each, handler in self._before.items():
            signal.signal(each, signal.SIG_IGN if self._last else handler)

    def _strike(self, _: int, frame: FrameType | None) -> None:
        self._struck = True
        if not self._held:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
            if not _loads_extension(frame):
                raise _Interrupt

    def _swallowed(self, ignored: sys.UnraisableHookArgs) -> None:
        # Python prints exceptions that a callback swallowed, for example a callback of
        # numba. Our own interrupts are not printed.
        if not issubclass(ignored.exc_type, _Interrupt):
            self._hook(ignored)

    def check(self) -> None:
        """Raises an interrupt that was held back.

        Raises:
            KeyboardInterrupt: There was an interrupt.
        """
        if self._struck:
            raise KeyboardInterrupt

    def take(self) -> None:
        """Forgets the last interrupt, because the command treats it as a normal end."""
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._struck = False

    def release(self) -> None:
        """Lets interrupts stop the work at any point from now on.

        Raises:
            KeyboardInterrupt: There was an interrupt before this call.
        """
        self._held = False
        self.check()

    def hold(self) -> None:
        """Makes later interrupts wait for the next call of ``check`` or ``release``."""
        self._held = True

    @contextmanager
    def held(self) -> Iterator[None]:
        """Makes interrupts wait within the ``with`` block.

        An interrupt waits until ``check`` is called or the block ends. If the block
        raises an exception, interrupts keep waiting afterwards, so that they cannot
        stop the cleanup.

        Raises:
            KeyboardInterrupt: There was an interrupt before or within the block.
        """
        self.check()
        before, self._held = self._held, True
        yield
        self._held = before
        self.check()

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Raises ``KeyboardInterrupt`` if an interrupt came within the ``with`` block.

        An interrupt within the block may lead to another exception, or to none. In both
        cases, this method raises ``KeyboardInterrupt``. After the block, interrupts
        wait, so that they cannot stop the cleanup or the move of result files.

        Raises:
            KeyboardInterrupt: There was an interrupt, even if it had no visible effect.
        """
        try:
            yield
        except BaseException:
            self.hold()
            if self._struck:
                raise KeyboardInterrupt from None
            raise
        self.hold()
        self.check()


def _loads_extension(frame: FrameType | None) -> bool:
    """Whether this frame or one of its callers is loading a C extension."""
    while frame is not None:
        if isinstance(frame.f_locals.get("self"), ExtensionFileLoader):
            return True
        frame = frame.f_back
    return False
