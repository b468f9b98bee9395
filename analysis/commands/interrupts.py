"""Ctrl-C and SIGTERM: when they may strike, and that none is lost."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ExtensionFileLoader
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
#: An interrupt that could not strike, or was swallowed, tries again after this, s.
_AGAIN_S = 0.1


class _Interrupt(KeyboardInterrupt):
    """An interrupt, but not ``KeyboardInterrupt`` itself.

    Where that one leaves a string that is evaluated, as in Drake's imports, Python
    dies of the signal at its end, even if it was caught.
    """


class Interrupts:
    """The interrupts of a command, as KeyboardInterrupt.

    A C extension that an interrupt strikes while it is loaded prints what it likes
    and raises something else: the interrupt waits. Callbacks of compiled code may
    swallow it: it strikes again until it is noticed.

    Args:
        last: Whether the process ends with the command: nothing is left then that
            an interrupt could stop, and Python's own end must not be cut short.
    """

    def __init__(self, *, last: bool = False) -> None:
        self._last = last
        self._held = True
        self._struck = False

    def __enter__(self) -> Interrupts:
        self._before = {each: signal.signal(each, self._strike) for each in _SIGNALS}
        self._hook, sys.unraisablehook = sys.unraisablehook, self._swallowed
        # Only now: one that strikes again needs the handler of the alarm.
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
        # Python prints what a callback, as numba's, has swallowed: not ours.
        if not issubclass(ignored.exc_type, _Interrupt):
            self._hook(ignored)

    def check(self) -> None:
        """Lets an interrupt through that was held back.

        Raises:
            KeyboardInterrupt: There was one.
        """
        if self._struck:
            raise KeyboardInterrupt

    def take(self) -> None:
        """One has ended what goes on until then: it counts no longer."""
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        self._struck = False

    def release(self) -> None:
        """From here on interrupts strike where they come.

        Raises:
            KeyboardInterrupt: There was one before.
        """
        self._held = False
        self.check()

    def hold(self) -> None:
        """From here on they wait for ``check`` or ``release``."""
        self._held = True

    @contextmanager
    def held(self) -> Iterator[None]:
        """Within it they wait for ``check`` or the end.

        After an exception they go on waiting: nothing must stop what cleans up.

        Raises:
            KeyboardInterrupt: There was one, before or within it.
        """
        self.check()
        before, self._held = self._held, True
        yield
        self._held = before
        self.check()

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Within it whatever an interrupt led to counts as that interrupt.

        Afterwards they wait: nothing must stop what cleans up or puts in place.

        Raises:
            KeyboardInterrupt: There was one, even if it seemed to do nothing.
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
    """Whether what runs was called by the initialisation of a C extension."""
    while frame is not None:
        if isinstance(frame.f_locals.get("self"), ExtensionFileLoader):
            return True
        frame = frame.f_back
    return False
