"""Range sensors that fail, to see what the rest does."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from systems.framework.parameters import Parameters, Time

FaultKind = Literal["silent", "blind", "frozen", "noisy"]
#: Numbers of the kinds; 0: sound.
SILENT, BLIND, FROZEN, NOISY = range(1, 5)
_KINDS: dict[FaultKind, int] = {
    "silent": SILENT,
    "blind": BLIND,
    "frozen": FROZEN,
    "noisy": NOISY,
}


class SensorFaultParameters(Parameters):
    """A range sensor that fails in a run, and how."""

    sensor: int = Field(default=1, ge=1, le=360)
    """Number of the sensor, counted from the left, from 1."""
    kind: FaultKind = "silent"
    """``silent``: it does not fire any more; ``blind``: it never has an echo;
    ``frozen``: it repeats its last reading; ``noisy``: its noise is 0.3 m more."""
    start_s: Time = 0.0
    """When that begins, s."""

    @property
    def number(self) -> int:
        """Of the kind."""
        return _KINDS[self.kind]
