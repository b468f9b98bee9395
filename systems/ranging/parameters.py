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

# See ``systems.ranging.objects`` for the port with objects.
# ``OBJECT_SLOTS``: number of slots of the port.
# ``OBJECT_SIZE``: number of elements of a slot.
OBJECT_SLOTS, OBJECT_SIZE = 8, 8

#: Two adjacent sensors are neighbors if their directions differ by at most this angle,
#: deg.
NEIGHBORS_DEG = 90.0


class RangeSensorParameters(Parameters):
    """Parameters of one range sensor with a cone (default: SRF-05, Han 2019, 4.2)."""

    model_config = ConfigDict(json_schema_extra=mark_shared)

    axis_deg: Angle = 0.0
    """Direction of the axis of the cone in B, counterclockwise from the x axis, deg."""
    position_m: Point = (0.0, 0.0)
    """Position of the sensor from P, in B axes, m."""
    beam_half_angle_deg: float = Field(default=15.0, gt=0.0, lt=90.0)
    """Half of the opening angle of the cone, deg."""
    minimum_range_m: Length = 0.03
    """Smallest reported range, m. Nearer surfaces give this range, too."""
    maximum_range_m: Length = 3.0
    """Largest range, m. Farther surfaces give no echo."""
    noise_m: NonNegativeLength = 0.001
    """Standard deviation of a range, m."""
    dropout_probability: Fraction = 0.0
    """Probability that an echo is lost."""


_THREE = tuple(RangeSensorParameters(axis_deg=axis) for axis in (30.0, 0.0, -30.0))


class UltrasonicParameters(Parameters):
    """Parameters of all range sensors. The default is three SRF-05 (Han 2019, 4.2)."""

    # After validation, each sensor has a complete record. The input may be in a shorter
    # form, see ``sensor_shorthand``.
    model_config = ConfigDict(
        json_schema_extra=lambda schema: add_shorthand(schema, RangeSensorParameters)
    )

    preset: SensorPreset = "three"
    """Named set of sensors. It gives the values of all other fields that are not set.
    The positions are those on the body of the robot."""
    sensors: Annotated[tuple[RangeSensorParameters, ...], Strict(False)] = _THREE
    """List of the sensors, from left to right.

    Each sensor has the field ``axis_deg``. It may also have its own values of the
    fields from ``position_m`` to ``dropout_probability``. A number n instead of a list
    defines n sensors with evenly spaced axes all around. The first of these sensors
    points backward.
    """
    period_s: Period = TICK_S
    """Time from one firing to the next, s."""
    firing: Literal["simultaneous", "sequential"] = "simultaneous"
    """Order in which the sensors fire. With ``simultaneous``, all sensors fire at once.
    With ``sequential``, the sensors fire one after the other, one per ``period_s``."""

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
        """Returns the values of one field of ``RangeSensorParameters`` for all sensors.

        The shape is (n,), or (n, 2) for ``position_m``.
        """
        return np.array([getattr(sensor, field) for sensor in self.sensors])

    @cached_property
    def neighbors(self) -> tuple[tuple[int, int], ...]:
        """Pairs of adjacent sensors, counted from 0, with the left sensor first."""
        around = [*self.axes_deg, self.axes_deg[0] - 360.0]
        pairs = [
            (k, (k + 1) % self.count)
            for k, (left, right) in enumerate(pairwise(around))
            if left - right <= NEIGHBORS_DEG
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
        """Returns the number of control periods (ticks) from one firing to the next.

        Args:
            tick_s: Control period, s.

        Returns:
            Number of control periods.

        Raises:
            InputError: The firing period is not a multiple of the control period.
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
        """Returns the number of control periods between two readings of a sensor."""
        rounds = self.count if self.firing == "sequential" else 1
        return rounds * self.period_ticks(tick_s)

    def turns(self, tick_s: float) -> NDArray[np.int64]:
        """(n,) tick within the round at which each sensor fires."""
        turns = np.arange(self.count) * self.period_ticks(tick_s)
        return turns if self.firing == "sequential" else 0 * turns


Aggregation = Literal["paper", "nearest", "sum"]
VelocityTerm = Literal["printed", "closing"]


class CollisionVectorParameters(Parameters):
    """Parameters of the conversion of echoes to collision vectors."""

    aggregation: Aggregation = "paper"
    """Rule that combines echoes into collision vectors.

    ``paper``: the block joins the nearest echo with a neighboring echo that is close
    enough. If both neighbors are close enough, the block uses the neighbor that is
    nearer to P. ``nearest``: the block uses only the nearest echo. ``sum``: the block
    makes one vector for each pair of close echoes and for each echo without a pair, but
    only the nearest three vectors count. The law adds the forces of these vectors.
    """
    velocity_term: VelocityTerm = "printed"
    """Definition of the speed s of an obstacle in the laws. With ``printed``, s is
    |dC/dt|, the rate of change of the collision vector C. With ``closing``, s is the
    speed of approach."""


class ObjectSensorParameters(Parameters):
    """Range and errors of the object sensor."""

    maximum_range_m: Length = 2.0
    """Range R of the scan, m (table 1). The sensor does not see objects beyond this
    range."""
    noise_m: NonNegativeLength = 0.0
    """Standard deviation of each coordinate of a position, m."""
    velocity_noise_m_s: NonNegativeSpeed = 0.0
    """Standard deviation of each component of a velocity, m/s."""
    latency_s: Time = 0.0
    """Age of the reported objects, s. The age must be a multiple of the tick."""
    occlusion: bool = False
    """Whether bodies hide other bodies behind them. A body is hidden if its nearest
    point and its four corners are all hidden."""
