"""Faults of range sensors."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from systems.framework.parameters import Parameters, Time

FaultKind = Literal["silent", "blind", "frozen", "noisy"]
#: Numbers of the kinds of faults; 0 is a sensor without a fault.
SILENT, BLIND, FROZEN, NOISY = range(1, 5)
_KINDS: dict[FaultKind, int] = {
    "silent": SILENT,
    "blind": BLIND,
    "frozen": FROZEN,
    "noisy": NOISY,
}


class SensorFaultParameters(Parameters):
    """A range sensor that fails during a run, and the kind of its fault."""

    sensor: int = Field(default=1, ge=1, le=360)
    """Number of the sensor, counted from the left, starting at 1."""
    kind: FaultKind = "silent"
    """``silent``: the sensor no longer fires; ``blind``: it never has an echo;
    ``frozen``: it repeats its last reading; ``noisy``: the standard deviation of its
    range is 0.3 m larger."""
    start_s: Time = 0.0
    """Start of the fault, s."""

    @property
    def number(self) -> int:
        """Number of the kind of the fault."""
        return _KINDS[self.kind]
