"""Ultrasonic range sensors: the three sensors of the papers, or any other set."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike, NDArray

from systems.base.robot import RobotParameters
from systems.framework.block import Block, Port, Step
from systems.framework.compiling import njit
from systems.framework.faults import (
    BLIND,
    FROZEN,
    NOISY,
    SILENT,
    Fault,
    fault_ticks,
)
from systems.framework.finite import check_finite
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.parameters import (
    Size,
)
from systems.framework.signals import TICK_S
from systems.ranging.parameters import UltrasonicParameters
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.world.cones import fan_ranges

#: Additional standard deviation of the ranges of a noisy sensor, m.
_NOISY_M = 0.3


@njit(cache=True)
def body_rectangles(
    poses_WO: NDArray[np.float64], sizes: NDArray[np.float64], more: int
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Collects the rectangles of the bodies, followed by empty rows for other bodies.

    Args:
        poses_WO: (3 n,) poses (x, y, theta) of the rectangles in the world frame W, m
            and rad.
        sizes: (3 n,) lengths, widths and radii of the rectangles, m.
        more: Number of empty rows, which the caller fills.

    Returns:
        (n + more, 6) rectangles (x, y, theta, length, width, radius) in W, m and rad.
    """
    count = len(sizes) // 3
    rectangles = np.empty((count + more, 6))
    for k in range(count):
        # An assignment to a slice would also compile error messages about shapes,
        # which takes seconds.
        for i in range(3):
            rectangles[k, i] = poses_WO[3 * k + i]
            rectangles[k, 3 + i] = sizes[3 * k + i]
    return rectangles


@njit(cache=True)
def world_rectangles(
    poses_WO: NDArray[np.float64],
    sizes: NDArray[np.float64],
    pose_WS: NDArray[np.float64] | tuple[float, float, float],
    source_size: tuple[float, float],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Collects the rectangles of all bodies, with the leader as the last body.

    Args:
        poses_WO: (3 n,) poses (x, y, theta) of the rectangles of the obstacles in the
            world frame W, m and rad.
        sizes: (3 n,) lengths, widths and radii of these rectangles, m.
        pose_WS: (3,) pose (x, y, theta) of the leader in W, m and rad.
        source_size: Length and width of the leader, m.

    Returns:
        (n + 1, 6) rectangles (x, y, theta, length, width, radius) in W, m and rad.
    """
    rectangles = body_rectangles(poses_WO, sizes, 1)
    count = len(rectangles) - 1
    for i in range(3):
        rectangles[count, i] = pose_WS[i]
    rectangles[count, 3], rectangles[count, 4] = source_size
    rectangles[count, 5] = 0.0
    return rectangles


def cone_ranges(
    pose_WB: ArrayLike,
    rectangles: NDArray[np.float64],
    parameters: UltrasonicParameters,
    control_point_m: float,
) -> NDArray[np.float64]:
    """Computes the true distance to the nearest surface in each cone.

    Args:
        pose_WB: Pose (x, y, theta) of the robot, m and rad.
        rectangles: (n, 6) rectangles (x, y, theta, length, width, radius) of the bodies
            in the world frame W, m and rad.
        parameters: Positions and directions of the k sensors.
        control_point_m: Distance of the control point P ahead of the axle, m.

    Returns:
        (k,) distances, m. The distance is infinite if a cone is empty.
    """
    pose = np.asarray(pose_WB, dtype=np.float64)
    return fan_ranges(pose, rectangles, *parameters.beams, control_point_m)


class RangeErrors(NamedTuple):
    """Errors and limits of the ranges."""

    stretch: float
    """Factor of all ranges, due to an error of the assumed speed of sound."""
    noise_m: NDArray[np.float64]
    """(n,) standard deviation of the noise of each sensor, m."""
    least_luck: NDArray[np.float64]
    """(n,) limits for the loss of echoes. An echo is lost if a standard normal random
    number is below the limit of the sensor."""
    low_m: NDArray[np.float64]
    """(n,) smallest range of each sensor, m."""
    high_m: NDArray[np.float64]
    """(n,) largest range of each sensor, m."""


def range_errors(parameters: UltrasonicParameters, stretch: float = 1.0) -> RangeErrors:
    """Collects the errors and limits of all sensors, with one element per sensor.

    ``stretch`` is the ratio of the assumed speed of sound to the true speed of sound.
    """
    from scipy.special import ndtri  # takes longer to load than all parameters

    return RangeErrors(
        stretch,
        parameters.each("noise_m"),
        ndtri(parameters.each("dropout_probability")),
        parameters.each("minimum_range_m"),
        parameters.each("maximum_range_m"),
    )


@njit(cache=True)
def measured_ranges(
    true_ranges: NDArray[np.float64],
    numbers: NDArray[np.floating],
    errors: RangeErrors,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # pragma: no cover  (compiled)
    """Computes the ranges that the sensors report.

    Args:
        true_ranges: (n,) true ranges, m; infinite where a cone is empty.
        numbers: (2, n) standard normal random numbers. The first row is the noise. The
            second row decides whether echoes are lost.
        errors: Errors and limits of the n sensors.

    Returns:
        Two (n,) arrays: ranges within the limits of each sensor, m; and echoes, 0 or 1.
        Without an echo, the range is the largest range of the sensor and has no
        meaning.
    """
    count = len(true_ranges)
    ranges, echo = np.copy(errors.high_m), np.zeros(count)
    for k in range(count):
        noise, luck = numbers[0, k], numbers[1, k]
        if true_ranges[k] <= errors.high_m[k] and luck >= errors.least_luck[k]:
            measured = errors.stretch * true_ranges[k] + errors.noise_m[k] * noise
            ranges[k] = min(max(measured, errors.low_m[k]), errors.high_m[k])
            echo[k] = 1.0
    return ranges, echo


class UltrasonicNumbers(NamedTuple):
    """Constants of ``ultrasonic_step``."""

    axes: NDArray[np.float64]
    """(n,) directions of the cones in B, rad."""
    places: NDArray[np.float64]
    """(n, 2) positions of the sensors relative to P, in the axes of B, m."""
    half_angles: NDArray[np.float64]
    """(n,) halves of the opening angles of the cones, rad."""
    control_point_m: float
    """Distance of P ahead of the axle, m."""
    source_size: tuple[float, float]
    """Length and width of the leader, m."""
    errors: RangeErrors
    noise: TickNoise
    turns: NDArray[np.int64]
    """(n,) number of the tick in the sensor round at which each sensor fires."""
    round: int
    """Length of a round, ticks."""
    tick_s: float
    faults: NDArray[np.int64]
    """(n, 2) faults, see ``fault_ticks``."""


def ultrasonic_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: UltrasonicNumbers
) -> None:
    """Computes the ranges of one control period.

    The state has the last readings: the ranges of all sensors, m, followed by the
    echoes of all sensors, 0 or 1.
    """
    pose_WB, poses_WO, sizes, pose_WS = inputs
    bodies = world_rectangles(poses_WO, sizes, pose_WS, numbers.source_size)
    _read_ranges(tick, state, pose_WB, bodies, outputs, numbers)


def sourceless_ultrasonic_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: UltrasonicNumbers
) -> None:
    """Computes the ranges of one control period in a scenario without a leader.

    Everything else is as in ``ultrasonic_step``.
    """
    pose_WB, poses_WO, sizes = inputs
    bodies = body_rectangles(poses_WO, sizes, 0)
    _read_ranges(tick, state, pose_WB, bodies, outputs, numbers)


@register_jitable
def _read_ranges(
    tick: int,
    state: Any,
    pose_WB: Any,
    bodies: Any,
    outputs: Any,
    numbers: UltrasonicNumbers,
) -> None:
    """Measures all ranges, applies the faults, and updates the sensors that fire.

    The function measures all sensors in every control period. A sensor stores its new
    reading only when it fires. The outputs are the stored readings and their ages.
    """
    ranges, echo, ages = outputs
    beams = numbers.axes, numbers.places, numbers.half_angles
    errors = numbers.errors
    reach_m = errors.high_m.max()
    true = fan_ranges(pose_WB, bodies, *beams, numbers.control_point_m, reach_m)
    count = len(true)
    normals = tick_normals(numbers.noise, tick, 2, count)
    new_ranges, new_echo = measured_ranges(true, normals, errors)
    for k in range(count):
        age = (tick - numbers.turns[k]) % numbers.round
        kind, begin = numbers.faults[k]
        late = tick - begin if kind > 0 else -1
        if late >= 0 and kind == SILENT:
            # The age counts from the last reading before the fault.
            age = late + 1 + (begin - 1 - numbers.turns[k]) % numbers.round
        elif late >= 0 and kind == BLIND:
            new_ranges[k], new_echo[k] = errors.high_m[k], 0.0
        elif late >= 0 and kind == NOISY:
            range_ = new_ranges[k] + _NOISY_M * float(normals[0, k])
            new_ranges[k] = min(max(range_, errors.low_m[k]), errors.high_m[k])
        if age == 0 and (late < 0 or kind != FROZEN):
            state[k], state[count + k] = new_ranges[k], new_echo[k]
        ranges[k], echo[k] = state[k], state[count + k]
        ages[k] = age * numbers.tick_s


class UltrasonicArray(Block):
    """Measures the distance to the nearest surface in the cone of each sensor.

    Each sensor has its own position, cone, range, and errors, so sensors of different
    kinds can work together. A sensor reports a range, but no direction within its cone.

    The leader is a body like the obstacles. Without a leader, there is no port
    ``pose_WS``. Surfaces beyond the maximum range give no echo. Surfaces nearer than
    the minimum range give the minimum range. If they gave no echo, the law would not
    push the robot away at contact.

    All sensors fire at multiples of ``period_s``, and hold their readings between these
    times. With ``firing: sequential``, only one sensor fires at each of these times,
    from left to right. For example, three sensors with a period of 25 ms have ranges
    that are 0, 25, and 50 ms old. Each sensor fires again after a round of 75 ms.

    The state has the last range and the last echo of each sensor. The output is a
    function of the state and the present poses. There is no latency. The block draws
    noise once per control period.

    Args:
        parameters: Parameters of the sensors, and the times at which they fire.
        faults: Faults of the robot. Only faults of ``ultrasonic`` have an effect.
        robot: Distance of the control point P ahead of the axle.
        sound_speed_m_s: True speed of sound, m/s.
        assumed_sound_speed_m_s: Speed of sound with which the sensors convert time to
            range, m/s. None: the true speed.
        source_size: Length and width of the leader, m. None: there is no leader.
        obstacle_count: Number of rectangles on the ports ``poses_WO`` and ``sizes``.
        seed: Seed of the noise.
        tick_s: Control period, s.

    Raises:
        InputError: The firing period is not a multiple of the control period, or a
            fault belongs to a sensor that does not exist.
    """

    part, stage = "ultrasonic", "obstacle sensing"
    inputs = (
        Port("pose_WB", 3, "m, m, rad"),
        Port("poses_WO", "3 rectangles", "m, m, rad each"),
        Port("sizes", "3 rectangles", "m, m, m each"),
        Port("pose_WS", 3, "m, m, rad"),
    )
    outputs = (
        Port("ranges", "sensors", "m", "range_{}"),
        Port("echo", "sensors", "0 or 1", "echo_{}"),
        Port("range_ages", "sensors", "s, since each sensor fired"),
    )

    def __init__(
        self,
        *,
        parameters: UltrasonicParameters = UltrasonicParameters(),
        faults: Sequence[Fault] = (),
        robot: RobotParameters = RobotParameters(),
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        assumed_sound_speed_m_s: float | None = None,
        source_size: Size | None = (0.326, 0.352),
        obstacle_count: int = 0,
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        check_finite("UltrasonicArray: source_size", source_size or ())
        self.set_name("ultrasonic_array")
        count = parameters.count
        numbers = UltrasonicNumbers(
            *parameters.beams,
            robot.control_point_m,
            source_size or (0.0, 0.0),
            range_errors(
                parameters,
                (assumed_sound_speed_m_s or sound_speed_m_s) / sound_speed_m_s,
            ),
            tick_noise(seed),
            parameters.turns(tick_s),
            parameters.round_ticks(tick_s),
            tick_s,
            fault_ticks(faults, "ultrasonic", count, tick_s),
        )
        self.declare(
            Step(
                ultrasonic_step if source_size else sourceless_ultrasonic_step,
                numbers,
                [*parameters.each("maximum_range_m").tolist(), *[0.0] * count],
            ),
            tick_s=tick_s,
            sizes={"rectangles": obstacle_count, "sensors": count},
            omit=() if source_size else ("pose_WS",),
            arrays=True,
        )
