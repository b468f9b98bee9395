"""Parameters of range sensors, contact switches, and object sensors."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, field_validator, model_validator

from systems.framework.input_error import InputError, shortened
from systems.framework.parameters import (
    Angle,
    Fraction,
    Length,
    NonNegativeLength,
    NonNegativeSpeed,
    Parameters,
    Period,
    Point,
    Time,
    with_preset,
)
from systems.framework.signals import TICK_S, whole
from systems.ranging.sensor_faults import SensorFaultParameters
from systems.ranging.sensor_presets import SENSOR_PRESETS, SensorPreset

#: Number of slots of a port with objects, and number of elements of each slot; see
#: ``systems.ranging.objects``.
OBJECT_SLOTS, OBJECT_SIZE = 8, 8

#: The directions of neighboring sensors differ by at most this angle, deg.
NEIGHBOURS_DEG = 90.0

_Axes = Annotated[tuple[Angle, ...], Strict(False), Field(min_length=1, max_length=360)]

_Places = Annotated[tuple[Point, ...], Strict(False), Field(max_length=360)]

_Faults = Annotated[
    tuple[SensorFaultParameters, ...], Strict(False), Field(max_length=360)
]


class UltrasonicParameters(Parameters):
    """Range finders: three SRF-05 (Han 2019, 4.2), or any others."""

    preset: SensorPreset = "three"
    """Named set of sensors. It provides the defaults of the other fields; fields that
    are set take precedence."""
    axes_deg: _Axes = (30.0, 0.0, -30.0)
    """Directions of the cones in B, counterclockwise from the x axis, deg. They are
    listed from left to right. An integer n stands for n evenly spaced cones all around,
    and the first cone points backward."""
    positions_m: _Places = ()
    """Positions of the sensors from P, in B axes, m. One position applies to all
    sensors; without a position, all sensors are at P."""
    beam_half_angle_deg: float = Field(default=15.0, gt=0.0, lt=90.0)
    """Half of the opening angle of each cone, deg."""
    minimum_range_m: Length = 0.03
    """Smallest reported range, m; nearer surfaces also give this range."""
    maximum_range_m: Length = 3.0
    """Largest range, m; farther surfaces give no echo."""
    noise_m: NonNegativeLength = 0.001
    """Standard deviation of a range, m."""
    dropout_probability: Fraction = 0.0
    """Probability that an echo is lost."""
    period_s: Period = TICK_S
    """Time from one firing to the next, s."""
    firing: Literal["simultaneous", "sequential"] = "simultaneous"
    """Whether all sensors fire at once, or one after the other with one period between
    them."""
    faults: _Faults = ()
    """Sensors that fail during a run."""

    @model_validator(mode="before")
    @classmethod
    def _fill(cls, data: Any) -> Any:
        return with_preset(data, SENSOR_PRESETS)

    @model_validator(mode="after")
    def _check(self) -> UltrasonicParameters:
        if self.minimum_range_m >= self.maximum_range_m:
            raise InputError(
                "minimum_range_m",
                f"{self.minimum_range_m} must be below "
                f"maximum_range_m {self.maximum_range_m}",
            )
        if any(b >= a for a, b in pairwise(self.axes_deg)):
            raise InputError(
                "axes_deg",
                f"{shortened(str(self.axes_deg), 80)} must fall from left to "
                "right, for example 30, 0, -30",
            )
        if self.axes_deg[0] - self.axes_deg[-1] >= 360.0:
            raise InputError(
                "axes_deg",
                f"{self.axes_deg[0]:g} to {self.axes_deg[-1]:g} is a turn or "
                "more; end before the first direction repeats",
            )
        for number, fault in enumerate(self.faults):
            if fault.sensor > self.count:
                raise InputError(
                    f"faults.{number}.sensor",
                    f"{fault.sensor} is not one of {self.count} sensors; lower it",
                )
        if len(self.positions_m) not in (0, 1, self.count):
            raise InputError(
                "positions_m",
                f"has {len(self.positions_m)} positions for {self.count} sensors "
                "of axes_deg; give one per sensor, one for all, or none",
            )
        return self

    @field_validator(
        "axes_deg",
        mode="before",
        json_schema_input_type=_Axes | Annotated[int, Field(ge=1, le=360)],
    )
    @classmethod
    def _ring(cls, axes: Any) -> Any:
        """Replaces a number by that many directions all around, starting at 180 deg."""
        if isinstance(axes, int) and not isinstance(axes, bool):
            if not 1 <= axes <= 360:
                raise InputError("", f"{axes} sensors; use 1 to 360")
            return tuple(180.0 - 360.0 * k / axes for k in range(axes))
        return axes

    @property
    def count(self) -> int:
        """Number of sensors."""
        return len(self.axes_deg)

    @property
    def places(self) -> tuple[tuple[float, float], ...]:
        """Positions of the sensors from P, in B axes, m."""
        if len(self.positions_m) == self.count:
            return self.positions_m
        return (self.positions_m or ((0.0, 0.0),)) * self.count

    @cached_property
    def neighbours(self) -> tuple[tuple[int, int], ...]:
        """Pairs of adjacent sensors, counted from 0, with the left sensor first."""
        around = [*self.axes_deg, self.axes_deg[0] - 360.0]
        pairs = [
            (k, (k + 1) % self.count)
            for k, (left, right) in enumerate(pairwise(around))
            if left - right <= NEIGHBOURS_DEG
        ]
        return tuple(pair for pair in pairs if pair[0] != pair[1])

    @cached_property
    def axes(self) -> tuple[float, ...]:
        """Directions of the cones in B, rad."""
        return tuple(map(math.radians, self.axes_deg))

    @cached_property
    def beams(self) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Directions (n,), rad, and positions (n, 2), m, in B; and half angle, rad."""
        half_angle = math.radians(self.beam_half_angle_deg)
        return np.array(self.axes), np.array(self.places), half_angle

    def period_ticks(self, tick_s: float) -> int:
        """Number of ticks from one firing to the next.

        Raises:
            InputError: The period is not a multiple of the tick.
        """
        ticks = self.period_s / tick_s
        if not whole(ticks):
            raise InputError(
                "period_s",
                f"{self.period_s:g} s is not a multiple of a tick of {tick_s:g} "
                "s; give a multiple",
            )
        return round(ticks)

    def round_ticks(self, tick_s: float) -> int:
        """Number of ticks from one reading of a sensor to its next reading."""
        rounds = self.count if self.firing == "sequential" else 1
        return rounds * self.period_ticks(tick_s)

    def turns(self, tick_s: float) -> NDArray[np.int64]:
        """(n,) tick within the round at which each sensor fires."""
        turns = np.arange(self.count) * self.period_ticks(tick_s)
        return turns if self.firing == "sequential" else 0 * turns

    def errors(self, stretch: float) -> tuple[float, float, float, float, float]:
        """Errors and limits of the ranges.

        Args:
            stretch: Assumed divided by true speed of sound.

        Returns:
            The stretch, by which the ranges are too long; standard deviation of the
            noise, m; the number ``least_luck``; smallest range, m; and largest range,
            m.
        """
        limits = self.minimum_range_m, self.maximum_range_m
        return stretch, self.noise_m, self.least_luck, *limits

    def fault_ticks(self, tick_s: float) -> NDArray[np.int64]:
        """(n, 2) kind of the fault of each sensor, 0 for none, and its first tick."""
        ticks = np.zeros((self.count, 2), dtype=np.int64)
        for fault in self.faults:
            begin = round(fault.start_s / tick_s)
            ticks[fault.sensor - 1] = fault.number, begin
        return ticks

    @cached_property
    def least_luck(self) -> float:
        """An echo is lost if its standard normal number is below this."""
        from scipy.special import ndtri  # takes longer to load than all parameters

        return float(ndtri(self.dropout_probability))


Aggregation = Literal["paper", "nearest", "sum"]
VelocityTerm = Literal["printed", "closing"]


class CollisionVectorParameters(Parameters):
    """Conversion of echoes to collision vectors."""

    aggregation: Aggregation = "paper"
    """``paper``: the nearest echo, joined with a neighboring echo that is close enough.
    If both neighbors are close enough, the echo nearer to P is used. ``nearest``: only
    the nearest echo. ``sum``: one vector per pair and per unpaired echo, but only the
    nearest three vectors. The forces of the vectors are added."""
    pair_separation_m: NonNegativeLength = 0.5
    """Largest distance between two echoes of the same obstacle, m."""
    velocity_term: VelocityTerm = "printed"
    """Definition of the speed s of an obstacle in the laws: ``printed`` is |dC/dt|,
    ``closing`` is the speed of approach only."""


class ContactFaultParameters(Parameters):
    """A switch that fails during a run, and the kind of its fault."""

    switch: int = Field(default=1, ge=1, le=2)
    """Number of the switch: 1 is left, 2 is right."""
    kind: Literal["stuck_open", "stuck_closed"] = "stuck_open"
    """``stuck_open``: the switch never closes; ``stuck_closed``: it never opens."""
    start_s: Time = 0.0
    """Start of the fault, s."""


class ContactParameters(Parameters):
    """The two switches behind the front bumper (Song 2011, 2.1), with our sizes."""

    reach_m: Length = 0.01
    """Distance between a body and the front edge up to which a switch closes, m."""
    faults: Annotated[
        tuple[ContactFaultParameters, ...], Strict(False), Field(max_length=2)
    ] = ()
    """Switches that fail during a run."""


class ObjectSensorParameters(Parameters):
    """Range and errors of the object sensor."""

    maximum_range_m: Length = 2.0
    """Range R of the scan, m (table 1); objects beyond it are not seen."""
    noise_m: NonNegativeLength = 0.0
    """Standard deviation of each coordinate of a position, m."""
    velocity_noise_m_s: NonNegativeSpeed = 0.0
    """Standard deviation of each component of a velocity, m/s."""
    latency_s: Time = 0.0
    """Age of the reported objects, s; a multiple of the tick."""
    occlusion: bool = False
    """Whether bodies hide other bodies behind them. A body is hidden if its nearest
    point and all four corners are hidden."""
