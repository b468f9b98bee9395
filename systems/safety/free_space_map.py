"""The block that remembers where range sensors have seen free floor or got echoes."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.lagged_motion import lagged_motion
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import OBJECT, Block, Port, Step
from systems.framework.signals import TICK_S
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.free_space import (
    MOST_SLACK,
    PARTS,
    FreeSpace,
    clear_disc,
    clear_outline,
    disc_is_free,
    make_free_space,
    move_window,
)
from systems.safety.outline import Outline, is_long
from systems.safety.parameters import LEAST_MARGIN_M, GuardParameters
from systems.safety.seen_cells import end_view, see
from systems.safety.views import (
    RANGE_MARGIN_M,
    PlaceError,
    Sectors,
    lasting,
    range_errors,
    sensor_sectors,
)

#: Largest angle between two points of a sensor's arc, seen from the sensor, rad.
_ARC_STEP = 0.035
#: Distance from the disc around a long body up to which there are fine cells, m.
_FINE_AHEAD_M = 0.9


class MapNumbers(NamedTuple):
    """Constants of the step of ``FreeSpaceMap``."""

    sectors: Sectors
    directions: NDArray[np.float64]
    """(sensors, 2) direction of the axis in B and half of the aperture, rad."""
    places: NDArray[np.float64]
    """(sensors, 2) position relative to the axle in B, m."""
    limits: NDArray[np.float64]
    """(sensors, 4) four distances per sensor, m: least range, greatest range, the
    largest amount by which a range is too long, and the standard deviation of the noise
    of a range.
    """
    error: PlaceError
    """Quantities that determine the position error of a cell due to odometry."""
    least_way: float
    """Least rolled distance of a rim in one control period, per commanded speed of the
    faster wheel, m/(rad/s). It is 0 if the angles of the encoders are not rounded.
    """
    outline: Outline
    margin_m: float
    """Distance from the disc around the body within which all cells have to be free,
    so that the cells of the disc stay free, m.
    """
    bubble: float
    """Radius of the disc that is assumed to be free at the start, m."""
    tick_s: float
    round_ticks: int
    """Number of control periods between two readings of a sensor."""


class MapState(NamedTuple):
    """State of ``FreeSpaceMap``."""

    free_space: FreeSpace
    was_at: NDArray[np.float64]
    """(3,) pose (x, y, theta) in the last control period, m and rad; NaN before the
    first period.
    """


def map_step(
    tick: int, state: MapState, inputs: Any, outputs: Any, numbers: MapNumbers
) -> None:
    """Updates the map in one control period; see ``systems.framework.block.Step``."""
    ranges, echo, ages, pose, commanded = inputs
    space, was_at, error = state.free_space, state.was_at, numbers.error
    time = tick * numbers.tick_s
    long = len(space.fine.hits) > 0
    move_window(space, pose[0], pose[1])
    if long:
        move_window(space.fine, pose[0], pose[1])
    # The first tick clears the start bubble. Each later tick adds the distance rolled
    # since the previous tick.
    if math.isnan(was_at[0]):
        clear_disc(
            space,
            pose[0],
            pose[1],
            numbers.bubble,
            lasting(numbers.bubble, error),
        )
    else:
        fastest = max(abs(commanded[0]), abs(commanded[1]))
        space.rolled_m[0] += rolled_way(
            was_at, pose, numbers.least_way * fastest, error
        )
    for k in range(3):
        was_at[k] = pose[k]
    # The body is where no obstacle is. If the disc around it is free, no obstacle is in
    # the disc either, and its cells are remembered as if they were seen now.
    radius = numbers.outline.radius_m
    until = space.rolled_m[0] + lasting(radius, error)
    clear_outline(space, pose, numbers.outline, until)
    if long:
        space.fine.rolled_m[0] = space.rolled_m[0]
        clear_outline(space.fine, pose, numbers.outline, until)
    if disc_is_free(space, pose[0], pose[1], radius + numbers.margin_m):
        clear_disc(space, pose[0], pose[1], radius, until)
    # Readings of the sensors that have fired in this tick.
    readings = np.empty((len(ranges), 4))
    for k in range(len(ranges)):
        readings[k, 0], readings[k, 1] = 0.0, np.inf
        readings[k, 2], readings[k, 3] = -np.inf, 1.0
        if ages[k] > 0.5 * numbers.tick_s:
            continue
        low, high, margin, noise_m = numbers.limits[k]
        # For an object nearer than the least range, the sensor reports the least range.
        # In this case, nothing counts as free.
        if echo[k] < 0.5:
            readings[k, 0], readings[k, 2] = high - margin, high - RANGE_MARGIN_M
        else:
            readings[k, 1] = ranges[k]
            if ranges[k] > low + margin:
                readings[k, 0] = ranges[k] - margin
            readings[k, 2] = ranges[k] - RANGE_MARGIN_M
        readings[k, 3] = noise_m
        place = numbers.places[k, 0], numbers.places[k, 1]
        direction = numbers.directions[k, 0], numbers.directions[k, 1]
        end_view(space.ends[k], time, pose, place, direction, readings[k, 0])
    # Each reading of a sensor updates different rows.
    turn_of_rows = tick // numbers.round_ticks
    see(space, turn_of_rows, pose, numbers.sectors, readings, error)
    if long:
        see(space.fine, turn_of_rows, pose, numbers.sectors, readings, error, 1)


@register_jitable
def rolled_way(was_at: Any, pose: Any, least: float, error: PlaceError) -> float:
    """Computes the mean distance that both wheel rims roll in one control period.

    ``place_error`` computes the position error from the sum of these distances.

    Args:
        was_at: Pose (x, y, theta) one control period ago, m and rad.
        pose: Present pose (x, y, theta), m and rad.
        least: Least distance that counts for each wheel, m. A wheel may have moved back
            and forth without a change of the pose.
        error: Errors of the odometry, with the wheel separation and the pulse of the
            encoders.

    Returns:
        Mean distance, m, plus half a pulse of the encoders, because the true distance
        may exceed the counted distance.
    """
    turn = pose[2] - was_at[2]
    # The path is longer than its chord by at most the factor 1/cos(turn/2). The factor
    # used here is larger.
    chord = math.hypot(pose[0] - was_at[0], pose[1] - was_at[1])
    way = chord * (1.0 + 0.25 * turn * turn)
    aside = 0.5 * error.wheel_separation_m * abs(turn)
    slower, faster = abs(way - aside), way + aside
    return 0.5 * (max(slower, least) + max(faster, least) + error.pulse_m)


class FreeSpaceMap(Block):
    """Remembers which cells range sensors have seen free, and where echoes came from.

    The floor around the robot is divided into square cells. The sensors at one position
    see a cell free if the circle around the cell is in their view, and if the whole
    circle is nearer than their readings minus a margin. One reading that exceeds the
    far side of the circle by 5 standard deviations of its noise is enough. Several
    readings are enough with smaller differences (``free_space.see``).

    A cell stays free while the error of its position relative to the robot is at most
    ``place_error_m``. The error grows as the robot drives, for two reasons: encoders
    count whole pulses, and the travel of each wheel has the relative error
    ``wheel_error``.

    Around a long body (``is_long``), each cell consists of smaller fine cells.
    They become free by the same rule, and each reading updates all of them.

    At the start, a disc around the axle with the radius ``start_bubble_m`` counts as
    free. The outline of the body always counts as free. While the disc around the axle
    that contains the outline is free, its cells are not forgotten.

    The abstract state contains ``FreeSpace`` and the pose of the last control period.
    The output depends on the state and the present inputs. There is no latency.

    Args:
        parameters: Cells, and errors of positions.
        sensors: Positions, apertures, ranges, and noise of the sensors.
        robot: Body, and position of the control point P.
        plant: Lag of the motors, and pulses of the encoders.
        tick_s: Control period, s.

    Reference: our own work; docs/guard.md has the theorem that depends on this block.
    """

    part, stage = "free_space", "obstacle sensing"
    inputs = (
        Port("ranges", "sensors", "m"),
        Port("echo", "sensors", "0 or 1"),
        Port("range_ages", "sensors", "s, since each sensor fired"),
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("wheel_speeds", 2, "rad/s, left and right, commanded"),
    )
    outputs = (Port("free_space", OBJECT, "FreeSpace"),)

    def __init__(
        self,
        *,
        parameters: GuardParameters = GuardParameters(),
        sensors: UltrasonicParameters = UltrasonicParameters(),
        robot: RobotParameters = RobotParameters(),
        plant: PlantParameters = PlantParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("free_space_map")
        axes, places, half_angles = sensors.beams
        place_error = PlaceError.of(parameters, robot, plant)
        least_way = 0.0
        if place_error.pulse_m > 0.0:
            motion = lagged_motion(tick_s, plant.motor_lag_s)
            steady = robot.wheel_radius_m * tick_s
            least_way = motion.least_share * steady
        points = 2 + math.ceil(2.0 * max(half_angles) / _ARC_STEP)
        numbers = MapNumbers(
            sensor_sectors(sensors, robot.control_point_m),
            np.column_stack([axes, half_angles]),
            np.add(places, [robot.control_point_m, 0.0]),
            np.column_stack(
                [
                    sensors.each("minimum_range_m"),
                    sensors.each("maximum_range_m"),
                    range_errors(sensors),
                    sensors.each("noise_m"),
                ]
            ),
            place_error,
            least_way,
            Outline.of(robot),
            parameters.place_error_m + LEAST_MARGIN_M,
            parameters.start_bubble_m,
            tick_s,
            sensors.round_ticks(tick_s),
        )
        cells = parameters.cells_for(body_radius(robot))
        fine_cells = 0
        if is_long(numbers.outline):
            fine_m = (body_radius(robot) + _FINE_AHEAD_M) / (parameters.cell_m / PARTS)
            fine_cells = 2 * (math.ceil(fine_m) + MOST_SLACK)
        space = make_free_space(
            cells, parameters.cell_m, sensors.count, points, fine_cells
        )
        self.declare(
            Step(map_step, numbers, MapState(space, np.full(3, np.nan))),
            tick_s=tick_s,
            sizes={"sensors": sensors.count},
        )
