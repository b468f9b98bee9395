"""The progress bar of a command."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NoReturn

from analysis.commands.interrupts import Interrupts

if TYPE_CHECKING:
    from tqdm import tqdm


class Progress:
    """A bar on a terminal, nothing in a pipe. Each call lets interrupts through.

    Args:
        interrupts: They are held back between the calls.
        total: What there is to do; nothing: there is no bar.
        unit: Of what is counted.
        done: What has been done before.
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

    def __call__(self, done: float) -> None:
        """Shows how much is done.

        Raises:
            KeyboardInterrupt: An interrupt has come meanwhile.
        """
        if self._bar is not None:
            self._bar.update(done - self._bar.n)
        self._interrupts.check()

    def take_interrupt(self) -> None:
        """An interrupt is how the command ends well."""
        self._interrupts.take()

    def step(self, title: str) -> None:
        """Names what comes next; what came before is done.

        Raises:
            KeyboardInterrupt: As a call.
        """
        if self._bar is not None:
            self._bar.set_description(title)
        self(self._steps)
        self._steps += 1
