"""The progress bar of a command."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NoReturn

from phonotaxis.commands.interrupts import Interrupts

if TYPE_CHECKING:
    from tqdm import tqdm


class Progress:
    """Shows a progress bar if standard error is a terminal, and handles interrupts.

    The work calls this object from time to time. If there was an interrupt since the
    last call, the call raises ``KeyboardInterrupt``.

    Args:
        interrupts: Handler of Ctrl-C and SIGTERM.
        total: Total amount of work, in ``unit``. If 0, there is no bar.
        unit: Unit of the work, for example runs.
        done: Amount of work that was done before the bar starts, in ``unit``.
    """

    def __init__(
        self, interrupts: Interrupts, total: float, unit: str, done: float = 0.0
    ) -> None:
        self._interrupts = interrupts
        self._bar: tqdm[NoReturn] | None = None
        if total and sys.stderr.isatty():
            from tqdm import tqdm

            left = "{remaining} left"
            form = f"{{l_bar}}{{bar}}| {{n:.0f}}/{{total:.0f}} {unit}, {left}"
            self._bar = tqdm(total=total, initial=done, bar_format=form, leave=False)
        self._steps = 0

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, done: float | str) -> None:
        """Shows how much work is done.

        Args:
            done: Either the amount of finished work, in the unit of the bar, or the
                name of the step that begins now. With names, the bar shows the number
                of finished steps.

        Raises:
            KeyboardInterrupt: An interrupt came since the last call.
        """
        if isinstance(done, str):
            if self._bar is not None:
                self._bar.set_description(done)
            done, self._steps = self._steps, self._steps + 1
        if self._bar is not None:
            self._bar.update(done - self._bar.n)
        self._interrupts.check()
