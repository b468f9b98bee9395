"""Parameters of range sensors and object sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    model_serializer,
    model_validator,
)

from systems.framework.input_error import InputError
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
)
from systems.framework.signals import TICK_S, whole
from systems.ranging.sensor_presets import SensorPreset
from systems.ranging.sensor_shorthand import (
    add_shorthand,
    check_shared,
    expanded,
    mark_shared,
    shortened_sensors,
)

#: Number of slots of a port with objects, and number of elements of each slot; see
#: ``systems.ranging.objects``.
OBJECT_SLOTS, OBJECT_SIZE = 8, 8

#: The directions of neighboring sensors differ by at most this angle, deg.
NEIGHBOURS_DEG = 90.0


class RangeSensorParameters(Parameters):
    """One range sensor with a cone: an SRF-05 (Han 2019, 4.2), or another one."""

    model_config = ConfigDict(json_schema_extra=mark_shared)

    axis_deg: Angle = 0.0
    """Direction of the axis of the cone in B, counterclockwise from the x axis, deg."""
    position_m: Point = (0.0, 0.0)
    """Position of the sensor from P, in B axes, m."""
    beam_half_angle_deg: float = Field(default=15.0, gt=0.0, lt=90.0)
    """Half of the opening angle of the cone, deg."""
    minimum_range_m: Length = 0.03
    """Smallest reported range, m; nearer surfaces also give this range."""
    maximum_range_m: Length = 3.0
    """Largest range, m; farther surfaces give no echo."""
    noise_m: NonNegativeLength = 0.001
    """Standard deviation of a range, m."""
    dropout_probability: Fraction = 0.0
    """Probability that an echo is lost."""


_THREE = tuple(RangeSensorParameters(axis_deg=axis) for axis in (30.0, 0.0, -30.0))


class UltrasonicParameters(Parameters):
    """Range finders: three SRF-05 (Han 2019, 4.2), or any others."""

    # After validation, each sensor has a complete record. The input may be shorter, see
    # ``sensor_shorthand``.
    model_config = ConfigDict(
        json_schema_extra=lambda schema: add_shorthand(schema, RangeSensorParameters)
    )

    preset: SensorPreset = "three"
    """Named set of sensors. It provides the defaults of the other fields; fields that
    are set take precedence."""
    sensors: Annotated[tuple[RangeSensorParameters, ...], Strict(False)] = _THREE
    """The sensors, from left to right. Each has ``axis_deg``, and may have values of
    its own of the fields from ``position_m`` to ``dropout_probability``. A number n
    stands for n sensors with evenly spaced axes all around, of which the first one
    points backward."""
    period_s: Period = TICK_S
    """Time from one firing to the next, s."""
    firing: Literal["simultaneous", "sequential"] = "simultaneous"
    """Whether all sensors fire at once, or one after the other with one period between
    them."""

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        check_shared(data, RangeSensorParameters)
        return expanded(data)

    @model_serializer(mode="wrap")
    def _shorten(self, standard: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return shortened_sensors(standard(self))

    @model_validator(mode="after")
    def _check(self) -> UltrasonicParameters:
        for k, sensor in enumerate(self.sensors):
            if sensor.minimum_range_m >= sensor.maximum_range_m:
                raise InputError(
                    f"sensors.{k}.minimum_range_m",
                    f"{sensor.minimum_range_m} must be below "
                    f"maximum_range_m {sensor.maximum_range_m}",
                )
        for k, (left, right) in enumerate(pairwise(self.axes_deg), start=1):
            if right >= left:
                raise InputError(
                    f"sensors.{k}.axis_deg",
                    f"{right:g} must be below {left:g}, that of the sensor before; "
                    "list the sensors from left to right, for example 30, 0, -30",
                )
        if self.axes_deg[0] - self.axes_deg[-1] >= 360.0:
            raise InputError(
                f"sensors.{self.count - 1}.axis_deg",
                f"{self.axes_deg[0]:g} to {self.axes_deg[-1]:g} is a turn or "
                "more; end before the first direction repeats",
            )
        return self

    @property
    def count(self) -> int:
        """Number of sensors."""
        return len(self.sensors)

    @property
    def axes_deg(self) -> tuple[float, ...]:
        """Directions of the cones in B, deg."""
        return tuple(sensor.axis_deg for sensor in self.sensors)

    @property
    def minimum_range_m(self) -> float:
        """Smallest range that any sensor reports, m."""
        return float(np.min(self.each("minimum_range_m")))

    @property
    def maximum_range_m(self) -> float:
        """Largest range of any sensor, m."""
        return float(np.max(self.each("maximum_range_m")))

    @property
    def noise_m(self) -> float:
        """Standard deviation of the ranges of the noisiest sensor, m."""
        return float(np.max(self.each("noise_m")))

    @property
    def dropout_probability(self) -> float:
        """Largest probability of any sensor that an echo is lost."""
        return float(np.max(self.each("dropout_probability")))

    @property
    def places(self) -> tuple[tuple[float, float], ...]:
        """Positions of the sensors from P, in B axes, m."""
        return tuple(sensor.position_m for sensor in self.sensors)

    def each(self, field: str) -> NDArray[np.float64]:
        """Returns the values of a field of all sensors.

        Args:
            field: Name of a field of ``RangeSensorParameters``.

        Returns:
            (n,) values; (n, 2) for ``position_m``.
        """
        return np.array([getattr(sensor, field) for sensor in self.sensors])

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
    def half_angles(self) -> tuple[float, ...]:
        """Halves of the opening angles of the cones, rad."""
        return tuple(math.radians(each.beam_half_angle_deg) for each in self.sensors)

    @cached_property
    def beams(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """(n,) axes, rad, (n, 2) positions, m, and (n,) half angles, rad, all in B."""
        return np.array(self.axes), np.array(self.places), np.array(self.half_angles)

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


Aggregation = Literal["paper", "nearest", "sum"]
VelocityTerm = Literal["printed", "closing"]


class CollisionVectorParameters(Parameters):
    """Conversion of echoes to collision vectors."""

    aggregation: Aggregation = "paper"
    """``paper``: the nearest echo, joined with a neighboring echo that is close enough.
    If both neighbors are close enough, the echo nearer to P is used. ``nearest``: only
    the nearest echo. ``sum``: one vector per pair and per unpaired echo, but only the
    nearest three vectors. The forces of the vectors are added."""
    velocity_term: VelocityTerm = "printed"
    """Definition of the speed s of an obstacle in the laws: ``printed`` is |dC/dt|,
    ``closing`` is the speed of approach only."""


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
