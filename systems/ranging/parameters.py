"""Parameters of range sensors, switches, and detectors of objects."""

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
    SoundSpeed,
    Speed,
    Time,
    with_preset,
)
from systems.framework.signals import TICK_S, whole
from systems.ranging.sensor_faults import SensorFaultParameters
from systems.ranging.sensor_presets import SENSOR_PRESETS, SensorPreset

#: Objects that a port holds, and numbers of each; see ``systems.ranging.objects``.
OBJECT_SLOTS, OBJECT_SIZE = 8, 8

#: Neighbours are sensors next to one another whose directions differ by this at most,
#: deg.
NEIGHBOURS_DEG = 90.0

_Axes = Annotated[tuple[Angle, ...], Strict(False), Field(min_length=1, max_length=360)]

_Places = Annotated[tuple[Point, ...], Strict(False), Field(max_length=360)]

_Faults = Annotated[
    tuple[SensorFaultParameters, ...], Strict(False), Field(max_length=360)
]


class UltrasonicParameters(Parameters):
    """Range finders: three SRF-05 (Han 2019, 4.2), or any others."""

    preset: SensorPreset = "three"
    """A named set: defaults of the other fields; fields that are set take
    precedence."""
    axes_deg: _Axes = (30.0, 0.0, -30.0)
    """Directions of the cones in B, left to right, deg CCW from x; or the number of
    cones all around."""
    positions_m: _Places = ()
    """Positions of the sensors from P, in B axes, m; one: for all sensors; none: all
    are at P."""
    beam_half_angle_deg: float = Field(default=15.0, gt=0.0, lt=90.0)
    """Half of each cone's opening angle, deg."""
    minimum_range_m: Length = 0.03
    """Nearer surfaces give this range, m."""
    maximum_range_m: Length = 3.0
    """Farther surfaces give no echo, m."""
    noise_m: NonNegativeLength = 0.001
    """Standard deviation of a range, m."""
    dropout_probability: Fraction = 0.0
    """Probability that an echo is missed."""
    period_s: Period = TICK_S
    """Time from one firing to the next, s."""
    firing: Literal["simultaneous", "sequential"] = "simultaneous"
    """All sensors at once, or one after the other, each for one period."""
    assumed_sound_speed_m_s: SoundSpeed | None = None
    """Speed of sound by which the sensors convert time to range, m/s; none: the true
    one."""
    faults: _Faults = ()
    """Sensors that fail."""

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
        """So many directions all around, one of them ahead."""
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
        """Of the sensors from P, in B axes, m."""
        if len(self.positions_m) == self.count:
            return self.positions_m
        return (self.positions_m or ((0.0, 0.0),)) * self.count

    @cached_property
    def neighbours(self) -> tuple[tuple[int, int], ...]:
        """Pairs of sensors next to one another, the left one first."""
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
        """Axes (n,) in B, rad, places (n, 2) from P, m, and half angle, rad."""
        half_angle = math.radians(self.beam_half_angle_deg)
        return np.array(self.axes), np.array(self.places), half_angle

    def period_ticks(self, tick_s: float) -> int:
        """Ticks from one firing to the next.

        Raises:
            InputError: The period is no multiple of the tick.
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
        """Ticks from one reading of a sensor to its next."""
        rounds = self.count if self.firing == "sequential" else 1
        return rounds * self.period_ticks(tick_s)

    def turns(self, tick_s: float) -> NDArray[np.int64]:
        """(n,) ticks into the round at which each sensor fires."""
        turns = np.arange(self.count) * self.period_ticks(tick_s)
        return turns if self.firing == "sequential" else 0 * turns

    def errors(self, sound_speed: float) -> tuple[float, float, float, float, float]:
        """Stretch of the ranges, noise, m, least luck, least and greatest range, m.

        Args:
            sound_speed: True speed of sound, m/s.

        Returns:
            As ``_measured_ranges`` takes them.
        """
        stretch = (self.assumed_sound_speed_m_s or sound_speed) / sound_speed
        limits = self.minimum_range_m, self.maximum_range_m
        return stretch, self.noise_m, self.least_luck, *limits

    def fault_ticks(self, tick_s: float) -> NDArray[np.int64]:
        """(n, 2) kind of each sensor's fault, 0 none, and tick of its begin."""
        ticks = np.zeros((self.count, 2), dtype=np.int64)
        for fault in self.faults:
            begin = round(fault.start_s / tick_s)
            ticks[fault.sensor - 1] = fault.number, begin
        return ticks

    @cached_property
    def least_luck(self) -> float:
        """Standard normal numbers below this drop an echo."""
        from scipy.special import ndtri  # takes longer to load than all parameters

        return float(ndtri(self.dropout_probability))


Aggregation = Literal["paper", "nearest", "sum"]


class CollisionVectorParameters(Parameters):
    """How echoes become collision vectors."""

    aggregation: Aggregation = "paper"
    """``paper``: the nearest echo, joined with its nearer neighbor if that is close
    enough; ``nearest``: only the nearest echo; ``sum``: one vector per echo or pair,
    whose forces add; if there are more than three, the nearest three."""
    pair_separation_m: NonNegativeLength = 0.5
    """Echoes farther apart than this are taken as two obstacles, m."""


class ContactFaultParameters(Parameters):
    """A switch that fails in a run, and how."""

    switch: int = Field(default=1, ge=1, le=2)
    """Which switch: 1 left, 2 right."""
    kind: Literal["stuck_open", "stuck_closed"] = "stuck_open"
    """``stuck_open``: it never closes; ``stuck_closed``: it never opens."""
    start_s: Time = 0.0
    """When that begins, s."""


class ContactParameters(Parameters):
    """The two switches behind the front bumper (Song 2011, 2.1), with our sizes."""

    reach_m: Length = 0.01
    """A switch closes where a body is this near to the front, m."""
    faults: Annotated[
        tuple[ContactFaultParameters, ...], Strict(False), Field(max_length=2)
    ] = ()
    """Switches that fail in a run."""


class ObjectSensorParameters(Parameters):
    """Range and errors of the object sensor."""

    maximum_range_m: Length = 2.0
    """Objects beyond it are not seen, m: R, the range of the scan (table 1)."""
    noise_m: NonNegativeLength = 0.0
    """Standard deviation of each coordinate of a position, m."""
    velocity_noise_m_s: NonNegativeSpeed = 0.0
    """Standard deviation of each component of a velocity, m/s."""
    latency_s: Time = 0.0
    """Age of the measured objects, s, a multiple of the tick."""
    occlusion: bool = False
    """Whether bodies hide those behind them, unless they leave a corner or the nearest
    place in view."""


class ObjectDetectorParameters(Parameters):
    """How beams become objects; the paper prints no values."""

    gap_m: Length = 0.2
    """Hits of neighboring beams belong to one object if they are nearer than this plus
    the spacing on a surface at the angle of the next field, m."""
    most_oblique_deg: float = Field(default=60.0, ge=0.0, le=85.0)
    """Angle of a beam to a surface's normal up to which hits belong together, deg."""
    dip_m: Length = 0.08
    """Two objects meet where the distance from P rises by this and falls again, m."""
    wide_m: Length = 0.8
    """The motion of an object along itself is not seen if the object is wider than
    this, m."""
    coarse_m: Length = 0.25
    """No velocity is known where beams are farther apart than this, m."""
    gate_m: Length = 0.3
    """An object farther than this from its predicted position counts as another object,
    m."""
    noise_m: NonNegativeLength = 0.04
    """Standard deviation of an object's distance in addition to the noise of ranges, m:
    beams hit other points of it from tick to tick."""
    velocity_change_m_s: Speed = 0.1
    """Standard deviation of a velocity's change within a second, m/s."""
    confirmation_s: Time = 0.5
    """An object's velocity is known when it was seen for this long, s."""
    memory_s: Time = 0.5
    """Time for which an object that beams do not see any more is kept, s."""
    resting_m_s: NonNegativeSpeed = 0.05
    """Objects slower than this count as at rest, m/s."""
