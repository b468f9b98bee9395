"""Converts estimates to the world frame W, and holds the target between bursts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.hearing.parameters import TrackerParameters
from systems.hearing.tracking.target_filter import (
    HYPOTHESIS,
    TRACK_NAMES,
    FilterSettings,
    ages,
    blank_memory,
    chosen_track,
    expected,
    fold,
)
from systems.sound.array_shape import ArrayShape
from systems.world.geometry import rotate

#: Standard deviation of errors that are not in the covariance of an estimate from
#: audio, m.
MEASUREMENT_FLOOR_M = 0.01

#: Rules for the target between bursts.
_HOLDS = "motion", "world", "robot"


class _Microphones(NamedTuple):
    """Positions of the microphones on the robot, m."""

    control_point: float
    """Distance of P ahead of the origin of B."""
    center_x: float
    """x of the centroid of the microphones relative to P, in B axes."""
    center_y: float
    """y of the centroid of the microphones relative to P, in B axes."""
    ahead_x: float
    """x of the normal of the row, in B axes. It has no effect without a row."""
    ahead_y: float
    """y of the normal of the row, in B axes."""


class TrackerNumbers(NamedTuple):
    """Data of the step of ``SourceTracker``."""

    hold: int
    """Index of the rule in ``_HOLDS``."""
    maximum_age_s: float
    past_ticks: int
    """Number of past poses that are stored."""
    age_ticks: float
    """Age of an estimate when it arrives, ticks."""
    frame_ticks: int
    """Ticks between two estimates."""
    microphones: _Microphones
    settings: FilterSettings
    older: NDArray[np.float64]
    """(n,) vector that the step adds to the memory of the filter, so that ages grow. It
    has the control period, s, for each age, and 0 for all other elements."""


def tracker_numbers(
    tracker: TrackerParameters,
    robot: RobotParameters,
    measurement_age_s: float,
    *,
    frame_s: float = TICK_S,
    tick_s: float = TICK_S,
    resolve_front_back: bool = True,
    floor_m: float = MEASUREMENT_FLOOR_M,
) -> TrackerNumbers:
    """Computes the constants of the tracker for one robot and one kind of hearing.

    Args:
        tracker: Parameters of the tracker.
        robot: Distance of the control point P ahead of the axle, and microphones.
        measurement_age_s: Time from a measurement to the arrival of its estimate, s.
        frame_s: Period of the estimates, s, a multiple of ``tick_s``.
        tick_s: Control period of the robot, s.
        resolve_front_back: Whether the tracker uses the motion of the robot to
            distinguish the source from its mirror image behind a row of microphones. If
            not, every source is in front.
        floor_m: Standard deviation of errors that are not in the covariance of an
            estimate, m.

    Returns:
        Constants for ``track_step``.
    """
    center_P = np.mean(robot.microphones_m, axis=0).tolist()
    ahead = ArrayShape.of(robot.microphones_m).ahead
    both = resolve_front_back and ahead is not None
    ahead_B = (1.0, 0.0) if ahead is None else ahead.tolist()
    age_ticks = measurement_age_s / tick_s
    return TrackerNumbers(
        _HOLDS.index(tracker.hold),
        tracker.maximum_age_s,
        max(2, math.ceil(age_ticks)),
        age_ticks,
        round(frame_s / tick_s),
        _Microphones(robot.control_point_m, *center_P, *ahead_B),
        FilterSettings(floor_m, measurement_age_s),
        tick_s * ages(2 if both else 1),
    )


def blank_track(numbers: TrackerNumbers, pose: Sequence[float]) -> NDArray[np.float64]:
    """Returns the (n,) state of ``track_step`` before anything is heard.

    ``pose`` is the odometry pose (x, y, theta), m and rad, at which the robot has been
    at rest. The function ``track_names`` returns the names of the elements of the
    state.
    """
    poses = np.tile(np.asarray(pose, dtype=float), numbers.past_ticks + 1)
    return np.concatenate((poses, blank_memory(_hypotheses(numbers))))


def track_names(numbers: TrackerNumbers) -> tuple[str, ...]:
    """Returns the names of the state elements of ``track_step``."""
    poses = (
        f"{pose}_{axis}"
        for pose in (
            *(f"pose_{k + 1}" for k in range(numbers.past_ticks)),
            "pose_heard",
        )
        for axis in ("x", "y", "theta")
    )
    memory = (
        name
        for k in range(_hypotheses(numbers))
        for name in (
            f"hypothesis_{k}_cost",
            f"hypothesis_{k}_outliers",
            *(f"track_{k}_{element}" for element in TRACK_NAMES),
            *(f"outlier_track_{k}_{element}" for element in TRACK_NAMES),
        )
    )
    return (*poses, "chosen", *memory)


def _hypotheses(numbers: TrackerNumbers) -> int:
    return (len(numbers.older) - 1) // HYPOTHESIS


def _for_scalars(function: Any) -> Any:
    """Makes a compiled function accept AutoDiffXd, too; it then runs in Python."""

    def call(*arguments: Any) -> Any:
        differentiated = arguments[0].dtype.hasobject
        return (function.py_func if differentiated else function)(*arguments)

    @overload(call, strict=False)
    def of_floats(*arguments: Any) -> Any:
        return lambda *arguments: function(*arguments)  # noqa: PLW0108

    return call


@register_jitable
def past_pose(pose: Any, past: Any, ticks: float) -> tuple[Any, Any, Any]:
    """Returns the odometry pose that the robot had some control periods (ticks) ago.

    Between two ticks, the function interpolates linearly.

    Args:
        pose: (3,) present x, y, theta in the world frame W, m and rad; floats or
            AutoDiffXd.
        past: (3 n,) x, y, theta at the last n ticks, most recent first, m and rad.
        ticks: Number of ticks ago, 0 to n, not necessarily whole.

    Returns:
        x, y, theta in W, m and rad.
    """
    before = max(math.ceil(ticks) - 1, 0)
    later = (pose[0], pose[1], pose[2])
    if before > 0:
        later = (past[3 * before - 3], past[3 * before - 2], past[3 * before - 1])
    share = ticks - before
    return (
        later[0] + share * (past[3 * before] - later[0]),
        later[1] + share * (past[3 * before + 1] - later[1]),
        later[2] + share * (past[3 * before + 2] - later[2]),
    )


@register_jitable
def _turned(c: Any, s: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Rotates (x, y) by the angle with cosine c and sine s."""
    return c * x - s * y, s * x + c * y


@njit(cache=True)
def _sighting(
    p_PS_B: NDArray[Any],
    covariance: NDArray[Any],
    ranged: float,
    pose: tuple[Any, Any, Any],
    microphones: _Microphones,
) -> NDArray[Any]:
    """Converts an estimate of the source to a sighting, the input of the filter.

    The function ``_sighting.py_func`` accepts AutoDiffXd.

    Args:
        p_PS_B: (2,) position of the source relative to the control point P, in the axes
            of the body frame B, m. If only the bearing is known, it is a unit vector.
        covariance: (4,) covariance of p_PS_B, row by row, m^2.
        ranged: 1 if the range is known, otherwise 0.
        pose: Pose of the robot at the moment of the measurement, m and rad.
        microphones: Positions of the microphones.

    Returns:
        (10,) sighting, see ``systems.hearing.tracking.target_filter``.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x_P = pose[0] + microphones.control_point * c
    y_P = pose[1] + microphones.control_point * s
    dx, dy = _turned(c, s, microphones.center_x, microphones.center_y)
    nx, ny = _turned(c, s, microphones.ahead_x, microphones.ahead_y)
    x, y = _turned(c, s, p_PS_B[0], p_PS_B[1])
    if ranged > 0.0:
        x, y = x_P + x, y_P + y
    # R C R^T
    ax, ay = _turned(c, s, covariance[0], covariance[2])
    bx, by = _turned(c, s, covariance[1], covariance[3])
    xx, xy = _turned(c, s, ax, bx)
    _, yy = _turned(c, s, ay, by)
    return np.array([x, y, xx, xy, yy, x_P + dx, y_P + dy, nx, ny, ranged])


_sighting_of = _for_scalars(_sighting)
_fold = _for_scalars(fold)
_expected = _for_scalars(expected)


@register_jitable
def _held_position(
    hold: int, chosen: Any, likely: Any, pose_heard: Any, pose: Any
) -> tuple[Any, Any]:
    """Returns (x, y) of the target in the world frame W, by the rule between bursts.

    ``hold`` is the index of the rule in ``_HOLDS``. ``chosen`` is the chosen track of
    the filter at its last estimate, and ``likely`` is the same track, predicted to the
    present.
    """
    if hold == 0:
        return likely[1], likely[2]
    if hold == 1:
        return chosen[1], chosen[2]
    dx, dy = rotate(
        pose[2] - pose_heard[2], chosen[1] - pose_heard[0], chosen[2] - pose_heard[1]
    )
    return pose[0] + dx, pose[1] + dy


def track_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TrackerNumbers
) -> None:
    """Updates the target of the tracker in one control period (tick).

    The step converts a new estimate to the world frame W and updates the filter. The
    outputs follow from the chosen track of the filter and the rule of ``hold``. The
    state has three parts, in this order:

    - the odometry poses at the last ticks, most recent first;
    - the pose at the moment of the last accepted estimate;
    - the memory of the filter.
    """
    p_PS_B, covariance, detected, range_valid, pose = inputs
    position, velocity, covariance_W, age, valid = outputs
    past, start = 3 * numbers.past_ticks, 3 * numbers.past_ticks + 3
    pose_heard, memory = state[past:start], state[start:]
    # An estimate is used once, one tick after the end of its frame.
    is_new = (tick - 1) % numbers.frame_ticks == 0
    if detected[0] > 0.5 and is_new:
        then = past_pose(pose, state[:past], numbers.age_ticks)
        ranged = 1.0 if range_valid[0] > 0.5 else 0.0
        microphones = numbers.microphones
        sighting = _sighting_of(p_PS_B, covariance, ranged, then, microphones)
        if _fold(memory, sighting, numbers.settings):
            # A loop, because assignment to a slice takes long to compile.
            for k in range(3):
                pose_heard[k] = then[k]
    chosen = chosen_track(memory)
    likely = _expected(memory)
    x, y = _held_position(numbers.hold, chosen, likely, pose_heard, pose)
    position[0], position[1] = x, y
    velocity[0], velocity[1] = likely[3], likely[4]
    # The covariance includes the offset between the held target and the expected
    # position.
    dx, dy = x - likely[1], y - likely[2]
    mixed = likely[6] + dx * dy
    covariance_W[0], covariance_W[1] = likely[5] + dx * dx, mixed
    covariance_W[2], covariance_W[3] = mixed, likely[7] + dy * dy
    age[0] = chosen[0]
    is_known = 1.0 if chosen[0] <= numbers.maximum_age_s else 0.0
    # A sum, because AutoDiffXd elements accept no float.
    valid[0] = 0.0 * chosen[0] + is_known
    for k in range(past - 1, 2, -1):
        state[k] = state[k - 3]
    for k in range(3):
        state[k] = pose[k]
    for k in range(len(memory)):
        memory[k] += numbers.older[k]
