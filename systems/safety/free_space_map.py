"""The memory of space: what the range sensors have seen free, and what they echoed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import check_finite, read_arrays
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.free_space import (
    NEVER,
    ROLLED,
    TICK,
    FreeSpace,
    clear_disc,
    end_view,
    make_free_space,
    move_window,
    see,
)
from systems.safety.parameters import FreeSpaceParameters
from systems.safety.views import Sectors, lasting, sensor_sectors

__all__ = [
    "FreeSpaceMap",
    "map_step",
]

#: Points of a sensor's arc are this near to one another, seen from it, rad.
_ARC_STEP = 0.035


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
