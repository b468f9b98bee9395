"""Baseline: VFH+, the vector field histogram of Ulrich and Borenstein, 1998."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.laws.baselines.baseline_controller import (
    MapController,
    half_size,
    occupied_around,
    split_at_disc,
)
from systems.laws.parameters import AttractionParameters
from systems.laws.vector_field_histogram import VectorFieldHistogramParameters
from systems.planning.body_contact import in_body_axes, time_to_contact
from systems.planning.following import FollowNumbers, approach, left_to_target
from systems.planning.turning import TURN_RATE_RAD_S, turn_toward, wrapped

# ``_SECTORS``: number of sectors of the histogram (5 deg each, as in the paper).
# ``_WIDE``: largest number of sectors of a narrow valley.
_SECTORS, _WIDE = 72, 16
# ``_TARGET_GAIN``: weight mu_1 of the angle to the target's direction (as in the
#   paper).
# ``_HEADING_GAIN``: weight mu_2 of the angle to the robot's heading (as in the paper).
_TARGET_GAIN, _HEADING_GAIN = 5.0, 2.0
#: Time within which the robot must not touch the target, s.
_SOON_S = 0.3
#: Distance within which cells count, in radii of the body's disc.
_WINDOW_RADII = 2.5
#: Ratio of the high threshold of the density to the low threshold.
_THRESHOLDS_RATIO = 2.0
#: Value of the direction if no direction was chosen.
_NONE = -1.0


class HistogramNumbers(NamedTuple):
    """Constants for choosing a direction; see ``VectorFieldHistogramParameters``."""

    window_m: float
    radius_m: float
    """Radius of the robot, including the clearance, m."""
    low_threshold: float
    previous_gain: float


class VectorFieldHistogramNumbers(NamedTuple):
    """Constants of the step of ``VectorFieldHistogramController``."""

    own: VectorFieldHistogramParameters
    histogram: HistogramNumbers
    follow: FollowNumbers
    half_size: tuple[float, float]
    """Half of the body's length and width, m."""


@njit(cache=True)
def _apart(one: float, other: float) -> float:  # pragma: no cover  (compiled)
    """Returns the angle between two directions, in sectors."""
    apart = abs(one - other) % _SECTORS
    return min(apart, _SECTORS - apart)


@njit(cache=True)
def polar_histogram(
    places: Any, x: float, y: float, numbers: HistogramNumbers
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the density of obstacles in each direction (VFH+, eq. 1-6).

    The paper calls this density the primary polar histogram. The function enlarges each
    occupied cell to a disc with the radius of the robot. It adds the magnitude of the
    cell to all sectors that the disc covers. The magnitude grows with the certainty of
    the cell and falls with its distance.

    Args:
        places: (n, 3) occupied cells: x and y in the world frame W, m, and the
            certainty, 0 to 1.
        x: Position of the robot, x in W, m.
        y: Position of the robot, y in W, m.
        numbers: Window and radius.

    Returns:
        (72,) density in each sector of 5 deg, counterclockwise from the x axis of W.
    """
    density = np.zeros(_SECTORS)
    width = math.tau / _SECTORS
    for n in range(len(places)):
        dx, dy = places[n, 0] - x, places[n, 1] - y
        distance = math.hypot(dx, dy)
        if distance > numbers.window_m:
            continue
        # a - b d^2 falls from a = 10 at the robot to 1 at the edge of the window.
        near = 10.0 - 9.0 * (distance / numbers.window_m) ** 2
        magnitude = places[n, 2] ** 2 * near
        # Half angle of the enlarged cell.
        wide = math.pi / 2.0
        if distance > numbers.radius_m:
            wide = math.asin(numbers.radius_m / distance)
        bearing = math.atan2(dy, dx)
        first = math.ceil((bearing - wide) / width)
        for k in range(first, math.floor((bearing + wide) / width) + 1):
            density[k % _SECTORS] += magnitude
    return density


@njit(cache=True)
def _mask(
    blocked: Any, places: Any, pose: Any, circle: float, numbers: HistogramNumbers
) -> None:  # pragma: no cover  (compiled)
    """Blocks the directions to which the moving robot cannot turn freely (eq. 8-13).

    The robot can turn left or right on circles of radius ``circle``. The function
    enlarges occupied cells by the radius of the robot. If a cell then meets the left
    circle, all directions to the left of the cell are blocked. Cells on the right
    circle block the right side.
    """
    x, y, theta = pose
    # From the robot to the center of the left circle.
    cx, cy = -circle * math.sin(theta), circle * math.cos(theta)
    left = right = math.pi
    for n in range(len(places)):
        dx, dy = places[n, 0] - x, places[n, 1] - y
        if math.hypot(dx, dy) > numbers.window_m:
            continue
        on_left = math.hypot(dx - cx, dy - cy) < circle + numbers.radius_m
        on_right = math.hypot(dx + cx, dy + cy) < circle + numbers.radius_m
        if on_left or on_right:
            off = wrapped(math.atan2(dy, dx) - theta)
            if on_left and off > 0.0:
                left = min(left, off)
            if on_right and off < 0.0:
                right = min(right, -off)
    for k in range(_SECTORS):
        off = wrapped(k * math.tau / _SECTORS - theta)
        if off > left or off < -right:
            blocked[k] = True


@njit(cache=True)
def choose_direction(
    blocked: Any,
    target: float,
    heading: float,
    previous: float,
    previous_gain: float,
) -> float:  # pragma: no cover  (compiled)
    """Chooses the candidate direction with the least cost (VFH+, eq. 14-18).

    A valley is a group of adjacent free sectors. The candidates are:

    - in a narrow valley: its middle
    - in a wide valley: one direction near each edge, and also the direction of the
      target if it lies between these two
    - if no sector is blocked: only the direction of the target

    Directions are angles counterclockwise from the x axis of the world frame, measured
    in sectors of 5 deg.

    Args:
        blocked: (72,) whether each sector is blocked.
        target: Direction of the target.
        heading: Heading of the robot.
        previous: Previously chosen direction, negative if there is none.
        previous_gain: Weight mu_3 of the angle to the previous direction.

    Returns:
        Chosen direction, or a negative number if all sectors are blocked.
    """
    anywhere = not blocked.any()
    begin = 0
    while begin < _SECTORS and not blocked[begin]:
        begin += 1
    candidates, count = np.empty(3 * _SECTORS), 0
    if anywhere:
        candidates[0], count = target, 1
    # Go around once, valley by valley, from a blocked sector.
    k = begin + 1
    while not anywhere and k < begin + _SECTORS:
        if blocked[k % _SECTORS]:
            k += 1
            continue
        first = k
        while not blocked[k % _SECTORS]:
            k += 1
        last = k - 1
        if last - first + 1 <= _WIDE:
            candidates[count] = 0.5 * (first + last)
            count += 1
            continue
        candidates[count] = first + 0.5 * _WIDE
        candidates[count + 1] = last - 0.5 * _WIDE
        count += 2
        within = (target - candidates[count - 2]) % _SECTORS
        if within <= last - first - _WIDE:
            candidates[count] = target
            count += 1
    # Candidate of least cost.
    best, found = np.inf, _NONE
    for n in range(count):
        cost = _TARGET_GAIN * _apart(candidates[n], target)
        cost += _HEADING_GAIN * _apart(candidates[n], heading)
        if previous >= 0.0:
            cost += previous_gain * _apart(candidates[n], previous)
        if cost < best:
            best, found = cost, candidates[n] % _SECTORS
    return found


@njit(cache=True)
def _steer(
    state: Any,
    places: Any,
    pose: Any,
    bearing: float,
    circle: float,
    numbers: HistogramNumbers,
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Chooses a direction and updates the state.

    The state contains one number per sector (1 if the thresholds block it), then the
    previous direction.

    Returns:
        Chosen direction in the world frame W, rad, and density of obstacles there; NaN
        and 0 if all sectors are blocked.
    """
    density = polar_histogram(places, pose[0], pose[1], numbers)
    blocked = np.empty(_SECTORS, dtype=np.bool_)
    for k in range(_SECTORS):
        if density[k] > _THRESHOLDS_RATIO * numbers.low_threshold:
            state[k] = 1.0
        elif density[k] < numbers.low_threshold:
            state[k] = 0.0
        blocked[k] = state[k] > 0.5
    _mask(blocked, places, pose, circle, numbers)
    width = math.tau / _SECTORS
    target, heading = (bearing / width) % _SECTORS, (pose[2] / width) % _SECTORS
    previous = state[_SECTORS]
    chosen = choose_direction(blocked, target, heading, previous, numbers.previous_gain)
    state[_SECTORS] = chosen
    if chosen < 0.0:
        return np.nan, 0.0
    return chosen * width, density[round(chosen) % _SECTORS]


@register_jitable
def _cells_ahead(inputs, numbers):  # type: ignore[no-untyped-def]
    """Lists the occupied cells that the body could meet on its way to the target.

    These are the cells within the window and nearer than the place where the robot
    wants to rest. Behind this place, a wall does not block the way. Cells near the
    target belong to the target.

    Returns:
        The cells on the way, and the cells of the target near the body.
    """
    target, pose, histogram = inputs[0], inputs[3], numbers.histogram
    reach = histogram.window_m
    if inputs[2][0] > 0.5:
        left = max(left_to_target(target, pose, numbers.follow), 0.0)
        reach = min(reach, left + histogram.radius_m)
    others, of_target = occupied_around(inputs, max(reach, 2.0 * histogram.radius_m))
    return split_at_disc(others, (pose[0], pose[1]), reach)[1], of_target


@njit(cache=True)
def _off_target(
    twist: tuple[float, float], cells: Any, pose: Any, half: tuple[float, float]
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Stops a motion that would soon touch the target.

    ``twist`` is the speed, m/s, and the yaw rate, rad/s. ``cells`` are those of the
    target. If the body would touch one of them within ``_SOON_S``, the robot does not
    turn. If it still would, the robot does not drive.
    """
    around, _ = in_body_axes(cells, pose, half)
    v, w = twist
    if time_to_contact(around, (v, w), half) < _SOON_S:
        w = 0.0
        if time_to_contact(around, (v, w), half) < _SOON_S:
            v = 0.0
    return v, w


@register_jitable
def vector_field_histogram_step(
    tick: int,
    state: Any,
    inputs: Any,
    outputs: Any,
    numbers: VectorFieldHistogramNumbers,
) -> None:
    """Computes speed and yaw rate of the robot for one control period.

    The state contains one number per sector (1 if the sector is blocked, otherwise 0),
    the previous direction in sectors, and the previous speed in m/s.
    """
    pose, own, twist = inputs[3], numbers.own, outputs[0]
    wanted, bearing = approach(inputs, numbers.follow)
    places, of_target = _cells_ahead(inputs, numbers)
    memory = np.empty(len(state))
    for k in range(len(memory)):
        memory[k] = state[k]
    at = pose[0], pose[1], pose[2]
    circle = abs(memory[_SECTORS + 1]) / TURN_RATE_RAD_S
    direction, density = _steer(memory, places, at, bearing, circle, numbers.histogram)
    if math.isnan(direction):
        # All directions are blocked. The robot does not drive forward, and turns to the
        # target.
        wanted, direction = min(wanted, 0.0), bearing
    elif wanted > 0.0:
        wanted *= max(1.0 - density / own.slow_density, 0.0)
    motion = turn_toward(wanted, direction, pose[2])
    twist[0], twist[1] = _off_target(motion, of_target, at, numbers.half_size)
    memory[_SECTORS + 1] = twist[0]
    for k in range(len(memory)):
        state[k] = memory[k]


class VectorFieldHistogramController(MapController):
    """Steers into the best gap between obstacles (VFH+).

    VFH+ is the vector field histogram of Ulrich and Borenstein. It divides all
    directions into 72 sectors. The obstacles are occupied cells of the map. A cell is
    occupied if an echo came from it and no sensor has seen it free since. In every
    control period, the block follows the stages of the paper:

    1. The primary histogram contains the density of obstacles in each sector. The block
       first enlarges each cell by the radius of the robot.
    2. The binary histogram marks a sector as blocked or free, by two thresholds of the
       density.
    3. The masked histogram also blocks directions to which the robot cannot turn at its
       present speed.
    4. The block chooses the candidate direction with the least cost.

    Cells behind the place where the robot wants to rest do not count, so that the robot
    also rests in narrow rooms. The speed falls with the density in the chosen
    direction, as in an earlier paper (Borenstein and Koren 1991). If all directions are
    blocked, the robot does not drive forward, but turns to the target. It stops before
    it touches the target.

    The discrete state contains the blocked sectors, the previous direction, and the
    previous speed. There is no latency.

    Args:
        robot: Size of the body, and position of the control point P ahead of the axle.
        attraction: ``AttractionParameters``. The block uses only the follow distance.
        gains: ``VectorFieldHistogramParameters``.
        tick_s: Control period, s.

    Reference: Ulrich and Borenstein, VFH+: reliable obstacle avoidance for fast mobile
    robots, IEEE Int. Conf. on Robotics and Automation, 1998.
    """

    def __init__(
        self,
        *,
        robot: RobotParameters = RobotParameters(),
        attraction: AttractionParameters = AttractionParameters(),
        gains: VectorFieldHistogramParameters = VectorFieldHistogramParameters(),
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("vector_field_histogram_controller")
        radius = body_radius(robot)
        histogram = HistogramNumbers(
            gains.window_m or _WINDOW_RADII * radius,
            radius + gains.clearance_m,
            gains.low_threshold,
            gains.previous_gain,
        )
        numbers = VectorFieldHistogramNumbers(
            gains,
            histogram,
            FollowNumbers(attraction.follow_distance_m, robot.control_point_m),
            half_size(robot),
        )
        state = [*[0.0] * _SECTORS, _NONE, 0.0]
        self.declare(Step(vector_field_histogram_step, numbers, state), tick_s=tick_s)
