"""Faults of the sensors of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import Parameters, Time

FaultySensor = Literal[
    "microphones", "ultrasonic", "gas_sensors", "contact_switches", "odometry"
]
FaultKind = Literal[
    "dead", "frozen", "silent", "blind", "noisy", "stuck_open", "stuck_closed", "lost"
]
#: Numbers of the kinds of faults; 0 is a sensor without a fault.
DEAD, FROZEN, SILENT, BLIND, NOISY, STUCK_OPEN, STUCK_CLOSED, LOST = range(1, 9)

#: Kinds of faults of each sensor.
KINDS: Mapping[FaultySensor, tuple[FaultKind, ...]] = {
    "microphones": ("dead", "frozen"),
    "ultrasonic": ("silent", "blind", "frozen", "noisy"),
    "gas_sensors": ("dead", "frozen"),
    "contact_switches": ("stuck_open", "stuck_closed"),
    "odometry": ("lost",),
}


class Fault(Parameters):
    """A sensor that fails during a run, and the kind of its fault."""

    sensor: FaultySensor
    """Kind of sensor that fails."""
    number: int = Field(default=1, ge=1, le=360)
    """Number of the sensor that fails, starting at 1. Microphones: their order in
    ``robot.microphones_m``. Ultrasonic sensors: from left to right. Gas sensors: 1
    right front, 2 rear, 3 left front. Contact switches: 1 left, 2 right. Odometry:
    1."""
    kind: FaultKind
    """Kind of the fault.

    Microphones: ``dead`` (the samples are 0) or ``frozen`` (the samples stay at a
    quarter of full scale). Ultrasonic sensors: ``silent`` (the sensor no longer fires),
    ``blind`` (it never has an echo), ``frozen`` (it repeats its last reading) or
    ``noisy`` (the standard deviation of its range is 0.3 m larger). Gas sensors:
    ``dead`` (the reading is 1, clean air, without noise) or ``frozen`` (the sensor
    repeats its last reading). Contact switches: ``stuck_open`` (the switch never
    closes) or ``stuck_closed`` (it never opens). Odometry: ``lost`` (the estimated pose
    is reset to (0, 0, 0) once).
    """
    start_s: Time = 0.0
    """Start of the fault, s."""

    @model_validator(mode="after")
    def _check(self) -> Fault:
        if self.kind not in (kinds := KINDS[self.sensor]):
            raise InputError(
                "kind",
                f"{self.kind} is not a fault of {self.sensor}; use "
                f"{' or '.join(kinds)}",
            )
        return self


Faults = Annotated[tuple[Fault, ...], Strict(False), Field(max_length=360)]


def faults_of(
    faults: Iterable[Fault], sensor: FaultySensor, count: int
) -> dict[int, Fault]:
    """Returns the faults of all sensors of one kind of a robot.

    Args:
        faults: All faults of the robot.
        sensor: Kind of the sensors.
        count: Number of sensors of this kind.

    Returns:
        Fault of each sensor that fails, by the index of the sensor, counted from 0.

    Raises:
        InputError: The number of a sensor is above ``count``, or one sensor has two
            faults.
    """
    found: dict[int, Fault] = {}
    for index, fault in enumerate(faults):
        if fault.sensor != sensor:
            continue
        field = f"faults.{index}.number"
        if fault.number > count:
            raise InputError(
                field,
                f"{fault.number} is not one of {count} {sensor}; give a number from 1 "
                f"to {count}",
            )
        if fault.number - 1 in found:
            raise InputError(
                field,
                f"{sensor} {fault.number} has two faults; keep one of them",
            )
        found[fault.number - 1] = fault
    return found


def fault_ticks(
    faults: Iterable[Fault], sensor: FaultySensor, count: int, tick_s: float
) -> NDArray[np.int64]:
    """Returns the faults of all sensors of one kind as numbers, for compiled code.

    Args:
        faults: All faults of the robot.
        sensor: Kind of the sensors.
        count: Number of sensors of this kind.
        tick_s: Control period (tick) of the robot, s.

    Returns:
        (count, 2) array with one row per sensor. The first column is the kind of the
        fault (``DEAD`` to ``LOST``), or 0 without a fault. The second column is the
        first tick of the fault.

    Raises:
        InputError: See ``faults_of``.
    """
    ticks = np.zeros((count, 2), dtype=np.int64)
    for k, fault in faults_of(faults, sensor, count).items():
        number = get_args(FaultKind).index(fault.kind) + 1
        ticks[k] = number, round(fault.start_s / tick_s)
    return ticks
