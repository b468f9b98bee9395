"""The memory of space: what the range sensors have seen free, and what they echoed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.base.lagged_motion import lagged_motion
from systems.base.parameters import OdometryParameters, PlantParameters
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
from systems.safety.views import PlaceError, Sectors, lasting, sensor_sectors

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
    error: PlaceError
    """Of the places of cells, by odometry."""
    least_way: float
    """Mean way of both rims that a tick counts for at least, m for each rad/s of the
    faster wheel's command; 0 without pulses."""
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
    ranges, echo, ages, pose, commanded = inputs
    space, was_at, error = numbers.space, numbers.was_at, numbers.error
    time = tick * numbers.tick_s
    low, high, margin = numbers.limits
    move_window(space, pose[0], pose[1])
    if space.facts[0, TICK] == NEVER:
        clear_disc(
            space,
            pose[0],
            pose[1],
            numbers.bubble,
            lasting(numbers.bubble, error),
        )
    else:
        fastest = max(abs(commanded[0]), abs(commanded[1]))
        space.facts[0, ROLLED] += rolled_way(
            was_at[0], pose, numbers.least_way * fastest, error
        )
    for k in range(3):
        was_at[0, k] = pose[k]
    space.facts[0, TICK] = tick
    if error.wheel_error > 0.0 or error.pulse_m > 0.0:
        until = space.facts[0, ROLLED] + lasting(numbers.radius, error)
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
    see(space, time, turn_of_rows, pose, numbers.sectors, readings, error)


@register_jitable
def rolled_way(was_at: Any, pose: Any, least: float, error: PlaceError) -> float:
    """Mean way of both rims in a tick, as ``place_error`` counts it.

    Args:
        was_at: Pose at the tick before, m and rad.
        pose: The same now.
        least: That a wheel counts for at least, m: it may have moved back and forth.
        error: Has the wheel separation and the pulse.

    Returns:
        m. By half a pulse it may be more than the encoders tell.
    """
    turn = pose[2] - was_at[2]
    # The way is longer than its chord, by 1/cos(turn/2) at most; this is more.
    chord = math.hypot(pose[0] - was_at[0], pose[1] - was_at[1])
    way = chord * (1.0 + 0.25 * turn * turn)
    aside = 0.5 * error.wheel_separation_m * abs(turn)
    slower, faster = abs(way - aside), way + aside
    return 0.5 * (max(slower, least) + max(faster, least) + error.pulse_m)


class FreeSpaceMap(LeafSystem):
    """Remembers what range sensors have seen free, and where echoes came from.

    .. pydrake_system::

        name: FreeSpaceMap
        input_ports:
        - ranges [m]
        - echo [0 or 1]
        - range_ages [s, since each sensor fired]
        - pose_WB_estimated [m, m, rad]
        - wheel_speeds [rad/s, left and right, commanded]
        output_ports:
        - free_space [FreeSpace]

    A cell has been seen free once its circumscribed circle lay within the apertures of
    sensors at one place, nearer than what they read, less a margin. It stays so as long
    as its place relative to the robot is known to ``place_error_m``: encoders count
    whole pulses, and ``wheel_error`` says how well the wheels are known. All sensors
    that fire at a tick are entered at it.

    At the start the bubble counts as free. The disc that holds the body counts as free
    at every tick, as ``MotionGuard`` keeps it so.

    Abstract state: ``FreeSpace``, and the pose at the last tick.
    Rate and latency: a function of state and present inputs, at every tick: no
    latency.

    Args:
        parameters: ``FreeSpaceParameters``.
        sensors: Places, apertures, ranges and noise of the sensors.
        robot: Its body, and place of P.
        odometry: Pulses of the encoders.
        plant: Lag of the motors.
        tick_s: Period of the robot, s.

    Raises:
        InputError: The grid does not serve the robot.

    Reference: ours; docs/guard.md has the theorem that rests on it.
    """

    FACTS = BlockFacts("free_space", "obstacle sensing")

    def __init__(
        self,
        *,
        parameters: FreeSpaceParameters | None = None,
        sensors: UltrasonicParameters | None = None,
        robot: RobotParameters | None = None,
        odometry: OdometryParameters | None = None,
        plant: PlantParameters | None = None,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self._parameters = parameters or FreeSpaceParameters()
        self._odometry = odometry or OdometryParameters()
        self._plant = plant or PlantParameters()
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
                ("wheel_speeds", 2),
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
        place_error = PlaceError.of(own, robot, self._odometry)
        least_way = 0.0
        if place_error.pulse_m > 0.0:
            motion = lagged_motion(self._tick_s, self._plant.motor_lag_s)
            steady = robot.wheel_radius_m * self._tick_s
            least_way = motion.least_share * steady
        points = 2 + math.ceil(2.0 * half_angle / _ARC_STEP)
        return MapNumbers(
            make_free_space(own.cells, own.cell_m, sensors.count, points),
            sensor_sectors(sensors, robot.control_point_m),
            np.column_stack([axes, np.full(len(axes), half_angle)]),
            np.add(places, [robot.control_point_m, 0.0]),
            (sensors.minimum_range_m, sensors.maximum_range_m, error),
            place_error,
            least_way,
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
