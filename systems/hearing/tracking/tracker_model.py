"""The target from burst to burst: estimates into W, and what is held between."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step
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


class Measurement(NamedTuple):
    """What a hearing block says; floats or AutoDiffXd."""

    p_PS_B: NDArray[Any]
    """(2,) source from P, m; a unit vector where only the bearing is known."""
    covariance: NDArray[Any]
    """(4,) of p_PS_B, row by row, m^2."""
    ranged: bool
    """Whether the range is known."""


class Track(NamedTuple):
    """The tracker's memory; floats or AutoDiffXd."""

    past_poses: NDArray[Any]
    """(n, 3) odometry poses one to n ticks ago."""
    pose_heard: NDArray[Any]
    """(3,) odometry pose of the moment of the last estimate."""
    memory: NDArray[Any]
    """The filter's, see ``systems.hearing.tracking.target_filter``."""

    @classmethod
    def unpack(cls, state: NDArray[Any], ticks: int) -> Track:
        """From the discrete state's vector, of which these are views.

        Args:
            state: (n,) what ``pack`` gave.
            ticks: Number of past poses.

        Returns:
            The track.
        """
        heard = 3 * ticks
        past_poses = state[:heard].reshape(ticks, 3)
        return cls(past_poses, state[heard : heard + 3], state[heard + 3 :])

    def pack(self) -> NDArray[Any]:
        """To the discrete state's vector."""
        return np.concatenate((self.past_poses.ravel(), *self[1:]))

    def names(self) -> tuple[str, ...]:
        """Of the elements of ``pack``."""
        poses = (
            f"{pose}_{axis}"
            for pose in (
                *(f"pose_{k + 1}" for k in range(len(self.past_poses))),
                "pose_heard",
            )
            for axis in ("x", "y", "theta")
        )
        memory = (
            name
            for k in range((len(self.memory) - 1) // HYPOTHESIS)
            for name in (
                f"hypothesis_{k}_cost",
                f"hypothesis_{k}_outliers",
                *(f"track_{k}_{element}" for element in TRACK_NAMES),
                *(f"outlier_track_{k}_{element}" for element in TRACK_NAMES),
            )
        )
        return (*poses, "chosen", *memory)

    @property
    def age(self) -> Any:
        """Since the measurement behind the target, s."""
        return chosen_track(self.memory)[0]


@register_jitable
def past_pose(poses: NDArray[Any], ticks: float) -> NDArray[Any]:
    """Odometry pose so many ticks ago, between ticks by a line.

    Args:
        poses: (n + 1, 3) x, y, theta in W now and at the last n ticks, m and rad;
            floats or AutoDiffXd.
        ticks: 0 to n, not whole.

    Returns:
        (3,) x, y, theta in W, m and rad.
    """
    after = max(math.ceil(ticks) - 1, 0)
    return poses[after] + (ticks - after) * (poses[after + 1] - poses[after])


class _Microphones(NamedTuple):
    """Where they are on the robot, m."""

    control_point: float
    """Distance of P ahead of the origin of B."""
    centre_x: float
    """Their centroid from P in B axes."""
    centre_y: float
    """See centre_x."""
    ahead_x: float
    """Normal of their row in B; anything where they are in no row."""
    ahead_y: float
    """See ahead_x."""


@register_jitable
def _turned(c: Any, s: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """(x, y) turned by the angle of cosine c and sine s."""
    return c * x - s * y, s * x + c * y


@njit(cache=True)
def _sighting(
    p_PS_B: NDArray[Any],
    covariance: NDArray[Any],
    ranged: float,
    poses: NDArray[Any],
    ticks: float,
    microphones: _Microphones,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """An estimate as the filter takes it; ``.py_func`` takes AutoDiffXd.

    Args:
        p_PS_B: See ``Measurement``.
        covariance: See ``Measurement``.
        ranged: 1 where the range is known, or 0.
        poses: (n + 1, 3) of the robot now and at the last n ticks.
        ticks: Age of the estimate.
        microphones: ``_Microphones``.

    Returns:
        Pose of the robot (3,) at the moment that the estimate is valid for, and
        the sighting (10,) of ``systems.hearing.tracking.target_filter``.
    """
    pose = past_pose(poses, ticks)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x_P = pose[0] + microphones.control_point * c
    y_P = pose[1] + microphones.control_point * s
    dx, dy = _turned(c, s, microphones.centre_x, microphones.centre_y)
    nx, ny = _turned(c, s, microphones.ahead_x, microphones.ahead_y)
    x, y = _turned(c, s, p_PS_B[0], p_PS_B[1])
    if ranged > 0.0:
        x, y = x_P + x, y_P + y
    # R C R^T
    ax, ay = _turned(c, s, covariance[0], covariance[2])
    bx, by = _turned(c, s, covariance[1], covariance[3])
    xx, xy = _turned(c, s, ax, bx)
    _, yy = _turned(c, s, ay, by)
    return pose, np.array([x, y, xx, xy, yy, x_P + dx, y_P + dy, nx, ny, ranged])


#: Rules for what the target does between bursts.
_HOLDS = "motion", "world", "robot"


@register_jitable
def _held_position(
    hold: int, chosen: Any, likely: Any, pose_heard: Any, pose: Any
) -> tuple[Any, Any]:
    """x and y of the target in W, by the rule of ``hold``.

    Args:
        hold: Place of the rule in ``_HOLDS``.
        chosen: The chosen track, as it was when last heard.
        likely: The same as it is expected to be now.
        pose_heard: Of the robot at the moment of the last estimate.
        pose: Of the robot now.
    """
    if hold == 0:
        return likely[1], likely[2]
    if hold == 1:
        return chosen[1], chosen[2]
    dx, dy = rotate(
        pose[2] - pose_heard[2], chosen[1] - pose_heard[0], chosen[2] - pose_heard[1]
    )
    return pose[0] + dx, pose[1] + dy


@register_jitable
def _held_covariance(likely: Any, position: Any) -> tuple[Any, Any, Any]:
    """xx, xy and yy of a target that is held at a position, m^2."""
    dx, dy = position[0] - likely[1], position[1] - likely[2]
    return likely[5] + dx * dx, likely[6] + dx * dy, likely[7] + dy * dy


class TrackerNumbers(NamedTuple):
    """What the step of ``SourceTracker`` depends on."""

    hold: int
    """Place of the rule in ``_HOLDS``."""
    maximum_age_s: float
    past_ticks: int
    """Number of past poses that are remembered."""
    age_ticks: float
    """Of an estimate when it arrives."""
    frame_ticks: int
    """Ticks from one estimate to the next."""
    microphones: _Microphones
    settings: FilterSettings
    older: NDArray[np.float64]
    """By what the filter's memory grows in a tick."""


def track_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: TrackerNumbers
) -> None:
    """The target of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: ``Track``.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``TrackerNumbers``.
    """
    p_PS_B, covariance, detected, range_valid, pose = inputs
    position, velocity, covariance_W, age, valid = outputs
    past, start = 3 * numbers.past_ticks, 3 * numbers.past_ticks + 3
    pose_heard, memory = state[past:start], state[start:]
    # An estimate counts once, at the tick after its frame's end.
    is_new = (tick - 1) % numbers.frame_ticks == 0
    if detected[0] > 0.5 and is_new:
        poses = np.empty((numbers.past_ticks + 1, 3))
        # Element by element: slices would compile words about their shapes.
        for j in range(3):
            poses[0, j] = pose[j]
            for k in range(numbers.past_ticks):
                poses[k + 1, j] = state[3 * k + j]
        then, sighting = _sighting(
            p_PS_B,
            covariance,
            range_valid[0],
            poses,
            numbers.age_ticks,
            numbers.microphones,
        )
        if fold(memory, sighting, numbers.settings):
            for j in range(3):
                pose_heard[j] = then[j]
    settings = numbers.settings
    chosen = chosen_track(memory)
    likely = expected(memory, settings.velocity_fade, settings.speed_std)
    held = _held_position(numbers.hold, chosen, likely, pose_heard, pose)
    xx, xy, yy = _held_covariance(likely, held)
    position[0], position[1] = held
    velocity[0], velocity[1] = likely[3], likely[4]
    covariance_W[0], covariance_W[1], covariance_W[2], covariance_W[3] = xx, xy, xy, yy
    age[0] = chosen[0]
    valid[0] = 1.0 if chosen[0] <= numbers.maximum_age_s else 0.0
    for k in range(past - 1, 2, -1):
        state[k] = state[k - 3]
    for k in range(3):
        state[k] = pose[k]
    for k in range(len(memory)):
        memory[k] += numbers.older[k]


def _of_scalars(memory: NDArray[Any], function: Any) -> Any:
    """A compiled function as it serves the memory's scalars, floats or AutoDiffXd."""
    return function.py_func if memory.dtype.hasobject else function


class TrackerModel:
    """The tracker's arithmetic for one robot and one kind of hearing.

    Args:
        tracker: Parameters.
        robot: Place of P, and microphones.
        measurement_age_s: From the moment an estimate is valid for to its
            arrival, s.
        tick_s: Period of the robot, s.
    """

    def __init__(
        self,
        tracker: TrackerParameters,
        robot: RobotParameters,
        measurement_age_s: float,
        tick_s: float = TICK_S,
    ) -> None:
        self._age_ticks = measurement_age_s / tick_s
        self.past_ticks = max(2, math.ceil(self._age_ticks))
        """Number of past poses that a track remembers."""
        self._hold = _HOLDS.index(tracker.hold)
        centre_P = np.mean(robot.microphones_m, axis=0).tolist()
        ahead = ArrayShape.of(robot.microphones_m).ahead
        both = tracker.resolve_front_back and ahead is not None
        self._hypotheses = 2 if both else 1
        ahead_B = (1.0, 0.0) if ahead is None else ahead.tolist()
        self._microphones = _Microphones(robot.control_point_m, *centre_P, *ahead_B)
        self._tick = tick_s * ages(self._hypotheses)
        self._settings = FilterSettings(
            speed_std=tracker.source_top_speed_m_s / 2.0,
            velocity_fade=tracker.velocity_fade_s,
            floor=tracker.measurement_floor_m,
            gate_floor=tracker.gate_floor_m,
            believed_outliers=tracker.believed_outliers,
            assumed_range=tracker.assumed_range_m,
            measurement_age=measurement_age_s,
        )

    def start(self, pose: Any) -> Track:
        """Nothing heard yet; before time zero the robot was where it starts."""
        pose = np.asarray(pose)
        past_poses = np.tile(pose, (self.past_ticks, 1))
        return Track(past_poses, pose, blank_memory(self._hypotheses))

    def hear(self, track: Track, estimate: Measurement, pose: Any) -> Track:
        """The track with an estimate folded in that arrives at ``pose``.

        Args:
            track: Before.
            estimate: Of the source, as it was a measurement's age ago.
            pose: (3,) odometry pose of the robot now, m and rad.

        Returns:
            A new track; an outlier leaves the pose of the last believed one.
        """
        poses = np.empty_like(track.past_poses, shape=(self.past_ticks + 1, 3))
        poses[0], poses[1:] = pose, track.past_poses
        p_PS_B, covariance, ranged = estimate
        memory = track.memory.copy()
        measured = p_PS_B, covariance, float(ranged)
        then, sighting = _of_scalars(memory, _sighting)(
            *measured, poses, self._age_ticks, self._microphones
        )
        believed = _of_scalars(memory, fold)(memory, sighting, self._settings)
        heard = then if believed else track.pose_heard
        return track._replace(pose_heard=heard, memory=memory)

    def older(self, track: Track, pose: Any) -> Track:
        """The track a tick later, when ``pose`` has become the last one.

        Args:
            track: At this tick.
            pose: (3,) odometry pose of the robot at this tick, m and rad.

        Returns:
            A new track, older by a tick.
        """
        memory = track.memory + self._tick
        past_poses = np.empty_like(track.past_poses)
        past_poses[0], past_poses[1:] = pose, track.past_poses[:-1]
        return Track(past_poses, track.pose_heard, memory)

    def position(self, track: Track, pose: Any) -> Any:
        """The target in W for a robot at ``pose``, (2,) m.

        Args:
            track: What is known of it.
            pose: (3,) odometry pose of the robot now, m and rad.

        Returns:
            x and y in W, m, by the rule of ``hold``.
        """
        chosen, likely = chosen_track(track.memory), self._expected(track)
        return _held_position(self._hold, chosen, likely, track.pose_heard, pose)

    def velocity(self, track: Track) -> Any:
        """Expected velocity of the source in W, (2,) m/s."""
        return self._expected(track)[3:5]

    def covariance(self, track: Track, pose: Any) -> Any:
        """Of the target in W, row by row, (4,) m^2.

        A target that is held elsewhere than the source is expected is off by
        that distance.

        Args:
            track: What is known of it.
            pose: (3,) odometry pose of the robot now, m and rad.

        Returns:
            xx, xy, yx, yy in W, m^2.
        """
        held = self.position(track, pose)
        xx, xy, yy = _held_covariance(self._expected(track), held)
        return [xx, xy, xy, yy]

    def step(self, pose: Any, frame_ticks: int, maximum_age_s: float) -> Step:
        """What ``SourceTracker`` does in a tick, for compiled loops.

        Args:
            pose: (3,) odometry pose of the robot at the start, m and rad.
            frame_ticks: Ticks from one estimate to the next.
            maximum_age_s: An older target is lost, s.

        Returns:
            The step.
        """
        numbers = TrackerNumbers(
            self._hold,
            maximum_age_s,
            self.past_ticks,
            self._age_ticks,
            frame_ticks,
            self._microphones,
            self._settings,
            self._tick,
        )
        return Step(track_step, numbers, self.start(pose).pack().tolist())

    def _expected(self, track: Track) -> Any:
        """The chosen track as it is expected to be now."""
        fade, speed_std = self._settings.velocity_fade, self._settings.speed_std
        return _of_scalars(track.memory, expected)(track.memory, fade, speed_std)
