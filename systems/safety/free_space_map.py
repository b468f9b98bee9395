"""The memory of space: what the range sensors have seen free, and what they echoed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import check_finite, read_arrays
from systems.framework.input_error import InputError
from systems.framework.parameters import Fraction, Length, NonNegativeLength, Parameters
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.ranging.ultrasonic_array import UltrasonicParameters
from systems.safety.free_space import (
    NEVER,
    ROLLED,
    TICK,
    FreeSpace,
    Sectors,
    clear_disc,
    end_view,
    lasting,
    make_free_space,
    move_window,
    see,
)

__all__ = [
    "FreeSpaceMap",
    "FreeSpaceParameters",
    "body_radius",
    "map_step",
    "sensor_sectors",
]

#: Cells of a window at most: 16 million take 0.4 GB.
_MOST_CELLS = 4_000
#: Points of a sensor's arc are this near to one another, seen from it, rad.
_ARC_STEP = 0.035
#: A range's error stays below so many standard deviations of it.
_SIGMAS = 5.0


class FreeSpaceParameters(Parameters):
    """How space is remembered."""

    cell_m: float = Field(default=0.05, ge=0.005, le=0.25)
    """Side of a cell, m."""
    window_m: Length = 12.8
    """Side of the square that is remembered, m; it moves along with the robot."""
    start_bubble_m: Length = 1.0
    """Radius about the axle in which nothing stands at the start, m: assumed."""
    range_margin_m: NonNegativeLength = 0.002
    """What ranges may be too long, m, besides five standard deviations of their
    noise."""
    wheel_error: Fraction = 0.0
    """To what share each wheel's way is known: of 0, space stays known for ever."""
    place_error_m: NonNegativeLength = 0.0
    """Error of place by ``wheel_error`` up to which a cell counts as free, m; the guard
    keeps off by as much more."""

    @property
    def cells(self) -> int:
        """Of the window along a side."""
        return math.ceil(self.window_m / self.cell_m - 1e-9)

    def range_error(self, sensors: UltrasonicParameters) -> float:
        """What ranges may be too long, m."""
        return self.range_margin_m + _SIGMAS * sensors.noise_m

    def check(self, robot: RobotParameters) -> None:
        """Refuses what cannot serve a robot.

        Args:
            robot: Its body.

        Raises:
            InputError: The grid is too coarse, too large or too small, or nothing
                would count as free for any way.
        """
        radius = body_radius(robot)
        if self.cells > _MOST_CELLS:
            raise InputError(
                "window_m",
                f"{self.window_m:g} m in cells of {self.cell_m:g} m are {self.cells}^2 "
                f"cells, more than {_MOST_CELLS}^2; lower it, or raise cell_m",
            )
        if self.start_bubble_m < radius + 2.0 * self.cell_m:
            raise InputError(
                "start_bubble_m",
                f"{self.start_bubble_m:g} m does not hold the body, which turns within "
                f"{radius:.3g} m, and two cells of {self.cell_m:g} m; raise it to "
                f"{radius + 2.0 * self.cell_m:.3g}, or lower cell_m",
            )
        if self.window_m < 4.0 * self.start_bubble_m:
            raise InputError(
                "window_m",
                f"{self.window_m:g} m is less than four times the bubble of "
                f"{self.start_bubble_m:g} m; raise it",
            )
        if self.wheel_error > 0.0 and self.place_error_m == 0.0:
            raise InputError(
                "place_error_m",
                f"is 0, but wheel_error is {self.wheel_error:g}: nothing would stay "
                "known; give what a place may be off, as 0.03",
            )


def body_radius(robot: RobotParameters) -> float:
    """Radius of the disc about the axle that holds the body at any heading, m."""
    return 0.5 * math.hypot(robot.length_m, robot.width_m)


def sensor_sectors(sensors: UltrasonicParameters, control_point_m: float) -> Sectors:
    """What a set of range sensors sees, as sectors of common places.

    Args:
        sensors: Any.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        The sectors.
    """
    half = math.radians(sensors.beam_half_angle_deg)
    places: dict[tuple[float, float], list[int]] = {}
    for k, place in enumerate(sensors.places):
        places.setdefault(place, []).append(k)
    first, right, left, seen_by = [0], [], [], []
    for members in places.values():
        spans = [(sensors.axes[k] - half, sensors.axes[k] + half) for k in members]
        for a, b in _between(spans):
            middle = 0.5 * (a + b)
            right.append(a)
            left.append(b)
            seen = np.zeros(sensors.count, dtype=bool)
            for k, (low, high) in zip(members, spans, strict=True):
                seen[k] = any(low < middle + t < high for t in (-math.tau, 0, math.tau))
            seen_by.append(seen)
        first.append(len(right))
    ahead = np.array([[control_point_m + x, y] for x, y in places])
    columns = np.reshape(right, (-1, 1)), np.reshape(left, (-1, 1))
    return Sectors(ahead, np.array(first), *columns, np.array(seen_by))


def _between(
    spans: Sequence[tuple[float, float]],
) -> list[tuple[float, float]]:
    """Sectors between neighbouring edges, from right to left; at most a turn."""
    edges = sorted(edge for span in spans for edge in span)
    if edges[-1] - edges[0] >= math.tau - 1e-9:
        begin = edges[0]
        edges = sorted(begin + (edge - begin) % math.tau for edge in edges)
        edges.append(begin + math.tau)
    return [(a, b) for a, b in pairwise(edges) if b - a > 1e-9]


class MapNumbers(NamedTuple):
    """What the step of ``FreeSpaceMap`` depends on."""

    space: FreeSpace
    """Changed by the step."""
    sectors: Sectors
    directions: NDArray[np.float64]
    """(sensors, 2) axis of each in B, rad, and half of its aperture, rad."""
    places: NDArray[np.float64]
    """(sensors, 2) from the axle in B, m."""
    limits: tuple[float, float, float]
    """Least and greatest range, m, and what ranges may be too long, m."""
    drift: tuple[float, float, float]
    """As of ``lasting``."""
    radius: float
    """Of the disc that holds the body, m."""
    bubble: float
    """Radius of what is free at the start, m."""
    tick_s: float
    round_ticks: int
    """From one reading of a sensor to its next."""
    was_at: NDArray[np.float64]
    """(1, 3) pose at the last tick, m and rad; changed."""


def map_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: MapNumbers
) -> None:
    """What is known at one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: None: all is in ``numbers.space``.
        inputs: As the input ports.
        outputs: None.
        numbers: ``MapNumbers``.
    """
    ranges, echo, ages, pose = inputs
    space, was_at = numbers.space, numbers.was_at
    time, (error, _, separation) = tick * numbers.tick_s, numbers.drift
    low, high, margin = numbers.limits
    move_window(space, pose[0], pose[1])
    if space.facts[0, TICK] == NEVER:
        clear_disc(
            space,
            pose[0],
            pose[1],
            numbers.bubble,
            lasting(numbers.bubble, numbers.drift),
        )
    else:
        way = math.hypot(pose[0] - was_at[0, 0], pose[1] - was_at[0, 1])
        turn = 0.5 * separation * abs(pose[2] - was_at[0, 2])
        space.facts[0, ROLLED] += max(way, turn)
    for k in range(3):
        was_at[0, k] = pose[k]
    space.facts[0, TICK] = tick
    if error > 0.0:
        until = space.facts[0, ROLLED] + lasting(numbers.radius, numbers.drift)
        clear_disc(space, pose[0], pose[1], numbers.radius, until)
    readings = np.empty((len(ranges), 2))
    for k in range(len(ranges)):
        readings[k, 0], readings[k, 1] = 0.0, np.inf
        if ages[k] > 0.5 * numbers.tick_s:
            continue
        # What is nearer than the least range reads that range.
        if echo[k] < 0.5:
            readings[k, 0] = high - margin
        else:
            readings[k, 1] = ranges[k]
            if ranges[k] > low + margin:
                readings[k, 0] = ranges[k] - margin
        place = numbers.places[k, 0], numbers.places[k, 1]
        direction = numbers.directions[k, 0], numbers.directions[k, 1]
        end_view(space, k, time, pose, place, direction, readings[k, 0])
    # Each sensor enters other rows with each of its readings.
    turn_of_rows = tick // numbers.round_ticks
    see(space, time, turn_of_rows, pose, numbers.sectors, readings, numbers.drift)


class FreeSpaceMap(LeafSystem):
    """Remembers what range sensors have seen free, and where echoes came from.

    .. pydrake_system::

        name: FreeSpaceMap
        input_ports:
        - ranges [m]
        - echo [0 or 1]
        - range_ages [s, since each sensor fired]
        - pose_WB_estimated [m, m, rad]
        output_ports:
        - free_space [FreeSpace]

    A cell has been seen free once its circumscribed circle lay within the apertures of
    sensors at one place, nearer than what they read, less a margin. It stays so: but
    with ``wheel_error`` for as long only as its place relative to the robot is known
    to ``place_error_m``. All sensors that fire at a tick are entered at it.

    At the start the bubble counts as free. With ``wheel_error`` the disc that holds
    the body counts as free at every tick, as ``MotionGuard`` keeps it so.

    Abstract state: ``FreeSpace``, and the pose at the last tick.
    Rate and latency: a function of state and present inputs, at every tick: no
    latency.

    Args:
        parameters: ``FreeSpaceParameters``.
        sensors: Places, apertures, ranges and noise of the sensors.
        robot: Its body, and place of P.
        tick_s: Period of the robot, s.

    Raises:
        InputError: The grid does not serve the robot.

    Reference: ours; docs/safety.md has the theorem that rests on it.
    """

    FACTS = BlockFacts("free_space", "obstacle sensing")

    def __init__(
        self,
        *,
        parameters: FreeSpaceParameters | None = None,
        sensors: UltrasonicParameters | None = None,
        robot: RobotParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self._parameters = parameters or FreeSpaceParameters()
        self._sensors = sensors or UltrasonicParameters()
        self._robot = robot or RobotParameters()
        self._parameters.check(self._robot)
        self._tick_s = tick_s
        self.set_name("free_space_map")
        self._numbers = self._make_numbers()
        count = self._sensors.count
        self._inputs = [
            self.DeclareVectorInputPort(name=name, size=size)
            for name, size in (
                ("ranges", count),
                ("echo", count),
                ("range_ages", count),
                ("pose_WB_estimated", 3),
            )
        ]
        blank = self._numbers.space, self._numbers.was_at
        self.DeclareAbstractState(Value(_copied(*blank)))
        self.DeclarePeriodicUnrestrictedUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._remember
        )
        sources = {port.ticket() for port in self._inputs}
        sources |= {self.time_ticket(), self.xa_ticket()}
        self._known: Any = declare_cache(self, "known", self._know, sources)
        self.DeclareAbstractOutputPort(
            name="free_space",
            alloc=lambda: Value(object()),
            calc=self._publish,
            prerequisites_of_calc={self._known.ticket()},
        )

    def _make_numbers(self) -> MapNumbers:
        own, sensors, robot = self._parameters, self._sensors, self._robot
        error = own.range_error(sensors)
        axes, places, half_angle = sensors.beams
        points = 2 + math.ceil(2.0 * half_angle / _ARC_STEP)
        return MapNumbers(
            make_free_space(own.cells, own.cell_m, sensors.count, points),
            sensor_sectors(sensors, robot.control_point_m),
            np.column_stack([axes, np.full(len(axes), half_angle)]),
            np.add(places, [robot.control_point_m, 0.0]),
            (sensors.minimum_range_m, sensors.maximum_range_m, error),
            (own.wheel_error, own.place_error_m, robot.wheel_separation_m),
            body_radius(robot),
            own.start_bubble_m,
            self._tick_s,
            sensors.round_ticks(self._tick_s),
            np.zeros((1, 3)),
        )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        space, was_at = _copied(self._numbers.space, self._numbers.was_at)
        run.carried["free_space"] = lambda _: space
        return Step(map_step, self._numbers._replace(space=space, was_at=was_at))

    def _publish(self, context: Any, output: Any) -> None:
        output.set_value(self._known.Eval(context)[0])

    def _know(self, context: Any) -> tuple[FreeSpace, NDArray[np.float64]]:
        state: Any = context.get_abstract_state(0).get_value()
        tick = round(context.get_time() / self._tick_s)
        # What was entered at this tick is not entered twice.
        if state[0].facts[0, TICK] == tick:
            known: tuple[FreeSpace, NDArray[np.float64]] = state
            return known
        space, was_at = _copied(*state)
        inputs = tuple(read_arrays(context, self._inputs))
        numbers = self._numbers._replace(space=space, was_at=was_at)
        map_step(tick, (), inputs, (), numbers)
        check_finite("FreeSpaceMap: pose_WB_estimated", was_at[0])
        return space, was_at

    def _remember(self, context: Any, state: Any) -> None:
        state.get_mutable_abstract_state(0).set_value(self._known.Eval(context))


def _copied(
    space: FreeSpace, was_at: NDArray[np.float64]
) -> tuple[FreeSpace, NDArray[np.float64]]:
    return space.copy(), np.copy(was_at)
