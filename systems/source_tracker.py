"""Tracks the source from burst to burst, and tells front from back by motion."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from systems.array_shape import ArrayShape
from systems.cache import declare_cache
from systems.geometry import control_point, rotate
from systems.parameters import NonNegative, Parameters, Positive
from systems.robot import RobotParameters
from systems.signals import FRAME_PERIOD_S
from systems.target_filter import (
    NEVER_HEARD_S,
    FilterSettings,
    ages,
    blank_memory,
    chosen_track,
    fold,
    predicted,
)

__all__ = [
    "Estimate",
    "SourceTracker",
    "SourceTracker_",
    "Track",
    "TrackerModel",
    "TrackerParameters",
    "past_pose",
]


class TrackerParameters(Parameters):
    """How the target is tracked."""

    hold: Literal["world", "robot", "motion"] = "motion"
    """Between bursts the target rests in W, moves with the robot, or goes on
    with its own velocity, which fades."""
    maximum_age_s: Positive = 6.0
    """An older target is lost: three periods of the sound, s."""
    assumed_range_m: Positive = 3.0
    """Range of the first target when only its bearing is known, m."""
    resolve_front_back: bool = True
    """Let the robot's motion tell the source from its mirror image behind a row
    of microphones; off: every source is in front."""
    source_top_speed_m_s: Positive = 0.7
    """Speed of a fast source, m/s: two standard deviations of each component of
    a velocity that is not known."""
    velocity_fade_s: Positive = 5.0
    """Time constant with which a source's velocity is forgotten, s."""
    measurement_floor_m: NonNegative = 0.01
    """Standard deviation of what the covariance of an estimate leaves out, m."""
    gate_floor_m: Positive = 0.2
    """Standard deviation that the gate allows for besides the covariances, m."""
    believed_outliers: int = Field(default=3, ge=1)
    """The outlier of this number in a row is believed, if they agree."""


class Estimate(NamedTuple):
    """What a hearing block says; floats or AutoDiffXd."""

    p_PS_B: list[Any]
    """Source from P, m; a unit vector where only the bearing is known."""
    covariance: list[Any]
    """Of p_PS_B, row by row, m^2."""
    ranged: bool
    """Whether the range is known."""


class Track(NamedTuple):
    """The tracker's memory; floats or AutoDiffXd."""

    pose_1: Any
    """Odometry pose one tick ago."""
    pose_2: Any
    """Odometry pose two ticks ago."""
    pose_heard: Any
    """Odometry pose of the moment of the last estimate."""
    memory: NDArray[Any]
    """The filter's, see ``systems.target_filter``."""

    @classmethod
    def unpack(cls, state: NDArray[Any]) -> Track:
        """From the discrete state's vector, of which these are views."""
        return cls(state[0:3], state[3:6], state[6:9], state[9:])

    def pack(self) -> NDArray[Any]:
        """To the discrete state's vector."""
        return np.concatenate(self)

    @property
    def age(self) -> Any:
        """Since the measurement behind the target, s."""
        return chosen_track(self.memory)[0]


def past_pose(pose_now, pose_1, pose_2, age):
    """Odometry pose ``age`` seconds ago, 0 to 50 ms, between ticks by a line."""
    ticks = age / FRAME_PERIOD_S
    newer, older, part = (
        (pose_now, pose_1, ticks) if ticks <= 1.0 else (pose_1, pose_2, ticks - 1.0)
    )
    return [a + part * (b - a) for a, b in zip(newer, older, strict=True)]


class TrackerModel:
    """The tracker's arithmetic for one robot and one kind of hearing.

    Args:
        tracker: Parameters.
        robot: Place of P, and microphones.
        measurement_age_s: From the moment an estimate is valid for to its
            arrival, s.
    """

    def __init__(
        self,
        tracker: TrackerParameters,
        robot: RobotParameters,
        measurement_age_s: float,
    ) -> None:
        self._hold = tracker.hold
        self._control_point_m = robot.control_point_m
        self._centre_P = np.mean(robot.microphones_m, axis=0).tolist()
        ahead = ArrayShape.of(robot.microphones_m).ahead
        both = tracker.resolve_front_back and ahead is not None
        self._hypotheses = 2 if both else 1
        # Where there is no row its normal does not count.
        self._ahead_B = (1.0, 0.0) if ahead is None else ahead.tolist()
        self._tick = FRAME_PERIOD_S * ages(self._hypotheses)
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
        return Track(pose, pose, pose, blank_memory(self._hypotheses))

    def hear(self, track: Track, estimate: Estimate, pose: Any) -> Track:
        """The track with an estimate folded in that arrives at ``pose``."""
        age = self._settings.measurement_age
        then = past_pose(pose, track.pose_1, track.pose_2, age)
        sighting = self._sighting(estimate, then)
        memory = track.memory.copy()
        function = fold.py_func if memory.dtype == object else fold
        believed = function(memory, sighting, self._settings)
        heard = np.array(then) if believed else track.pose_heard
        return track._replace(pose_heard=heard, memory=memory)

    def older(self, track: Track, pose: Any) -> Track:
        """The track a tick later, when ``pose`` has become the last one."""
        memory = track.memory + self._tick
        return Track(pose, track.pose_1, track.pose_heard, memory)

    def position(self, track: Track, pose: Any) -> Any:
        """The target in W for a robot at ``pose``, (2,) m."""
        if self._hold == "motion":
            return self._expected(track)[1:3]
        held = chosen_track(track.memory)[1:3]
        if self._hold == "world":
            return held
        x_B, y_B, theta = track.pose_heard
        dx, dy = rotate(pose[2] - theta, held[0] - x_B, held[1] - y_B)
        return [pose[0] + dx, pose[1] + dy]

    def velocity(self, track: Track) -> Any:
        """Expected velocity of the source in W, (2,) m/s."""
        return self._expected(track)[3:5]

    def covariance(self, track: Track, pose: Any) -> Any:
        """Of the target in W, row by row, (4,) m^2.

        A target that is held elsewhere than the source is expected is off by
        that distance.
        """
        held = self.position(track, pose)
        _, x, y, _, _, xx, xy, yy = self._expected(track)[:8]
        dx, dy = held[0] - x, held[1] - y
        mixed = xy + dx * dy
        return [xx + dx * dx, mixed, mixed, yy + dy * dy]

    def _expected(self, track: Track) -> Any:
        """The track as it is expected to be now."""
        last = chosen_track(track.memory)
        if last[0] >= NEVER_HEARD_S:
            return last
        function = predicted.py_func if last.dtype == object else predicted
        return function(last, last[0], self._settings)

    def _sighting(self, estimate: Estimate, pose: Any) -> NDArray[Any]:
        """An estimate in W, see ``systems.target_filter``."""
        x_P, y_P = control_point(pose, self._control_point_m)
        dx, dy = rotate(pose[2], *self._centre_P)
        ahead = rotate(pose[2], *self._ahead_B)
        x, y = rotate(pose[2], *estimate.p_PS_B)
        if estimate.ranged:
            x, y = x_P + x, y_P + y
        covariance = _covariance_in_world(estimate.covariance, pose[2])
        centre = x_P + dx, y_P + dy
        ranged = float(estimate.ranged)
        return np.array([x, y, *covariance, *centre, *ahead, ranged])


def _covariance_in_world(covariance, theta):
    """xx, xy and yy of R C R^T for a covariance given row by row."""
    a = rotate(theta, covariance[0], covariance[2])
    b = rotate(theta, covariance[1], covariance[3])
    xx, xy = rotate(theta, a[0], b[0])
    _, yy = rotate(theta, a[1], b[1])
    return xx, xy, yy


@TemplateSystem.define("SourceTracker_", T_list=[float, AutoDiffXd])
def SourceTracker_(T):
    class Impl(LeafSystem_[T]):
        """Knows where the source is, from the estimates that it hears.

        .. pydrake_system::

            name: SourceTracker
            input_ports:
            - p_PS_B [m]
            - covariance [m^2, of p_PS_B, row by row]
            - detected [0 or 1]
            - range_valid [0 or 1]
            - pose_WB_estimated [m, m, rad]
            output_ports:
            - p_WS_estimated [m]
            - v_WS_estimated [m/s]
            - covariance_W [m^2, row by row]
            - age [s]
            - target_valid [0 or 1]

        A Kalman filter in W (``systems.target_filter``). A new estimate is
        placed by the odometry pose of the moment it was measured,
        ``measurement_age_s`` ago; one without range counts across its bearing
        alone. An estimate that no source can have reached is dropped, unless
        several in a row agree. Between bursts the target rests in W, moves with
        the robot, or goes on with its velocity, as ``hold`` says; the
        covariance counts where it would be expected instead. Nothing heard yet,
        or a target older than ``maximum_age_s``: ``target_valid`` is 0, and the
        controllers stop the robot.

        Discrete state, 25 ms: ``Track``. The outputs continue it by the
        present estimate: no latency.

        Args:
            robot: Place of P, and microphones.
            tracker: ``TrackerParameters``.
            measurement_age_s: From the moment an estimate is valid for to its
                arrival, s, 0 to 50 ms: a tick for the ideal sensor, a tick
                and half a frame for the audio chain.
        """

        def _construct(
            self,
            *,
            robot=None,
            tracker=None,
            measurement_age_s=FRAME_PERIOD_S,
            converter=None,
        ):
            super().__init__(converter=converter)
            if not 0.0 <= measurement_age_s <= 2.0 * FRAME_PERIOD_S:
                raise ValueError(
                    f"SourceTracker: measurement_age_s is {measurement_age_s}; it "
                    f"must lie between 0 and {2.0 * FRAME_PERIOD_S}"
                )
            self._config = {
                "robot": robot or RobotParameters(),
                "tracker": tracker or TrackerParameters(),
                "measurement_age_s": measurement_age_s,
            }
            self._model = TrackerModel(**self._config)
            self._maximum_age = self._config["tracker"].maximum_age_s
            self.set_name("source_tracker")
            self._p_PS_B, self._covariance, self._detected, self._range_valid = (
                self.DeclareVectorInputPort(name=name, size=size)
                for name, size in (
                    ("p_PS_B", 2),
                    ("covariance", 4),
                    ("detected", 1),
                    ("range_valid", 1),
                )
            )
            self._pose = self.DeclareVectorInputPort(name="pose_WB_estimated", size=3)
            blank = self._model.start([0.0] * 3)
            self.DeclareDiscreteState([T(value) for value in blank.pack()])
            self.DeclareInitializationDiscreteUpdateEvent(update=self._start)
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=FRAME_PERIOD_S, offset_sec=0.0, update=self._update
            )
            sources = {
                port.ticket()
                for port in (
                    self._p_PS_B,
                    self._covariance,
                    self._detected,
                    self._range_valid,
                    self._pose,
                )
            }
            sources.add(self.xd_ticket())
            self._now = declare_cache(self, "track now", self._track, sources)
            for name, size, calc in (
                ("p_WS_estimated", 2, self._target),
                ("v_WS_estimated", 2, self._velocity),
                ("covariance_W", 4, self._target_covariance),
                ("age", 1, self._age),
                ("target_valid", 1, self._valid),
            ):
                self.DeclareVectorOutputPort(
                    name=name,
                    size=size,
                    calc=calc,
                    prerequisites_of_calc={self._now.ticket(), self._pose.ticket()},
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, **other._config, converter=converter)

        def _start(self, context, discrete_state):
            track = self._model.start(self._pose.Eval(context))
            discrete_state.get_mutable_vector().SetFromVector(track.pack())

        def _track(self, context):
            """The track with the present estimate folded in."""
            track = Track.unpack(context.get_discrete_state(0).CopyToVector())
            if self._detected.Eval(context)[0] > 0.5:  # noqa: PLR2004
                estimate = Estimate(
                    self._p_PS_B.Eval(context).tolist(),
                    self._covariance.Eval(context).tolist(),
                    bool(self._range_valid.Eval(context)[0] > 0.5),  # noqa: PLR2004
                )
                track = self._model.hear(track, estimate, self._pose.Eval(context))
            return track

        def _update(self, context, discrete_state):
            track, pose = self._now.Eval(context), self._pose.Eval(context)
            track = self._model.older(track, pose)
            discrete_state.get_mutable_vector().SetFromVector(track.pack())

        def _target(self, context, output):
            track, pose = self._now.Eval(context), self._pose.Eval(context)
            output.SetFromVector(self._model.position(track, pose))

        def _velocity(self, context, output):
            output.SetFromVector(self._model.velocity(self._now.Eval(context)))

        def _target_covariance(self, context, output):
            track, pose = self._now.Eval(context), self._pose.Eval(context)
            output.SetFromVector(self._model.covariance(track, pose))

        def _age(self, context, output):
            output.SetFromVector([self._now.Eval(context).age])

        def _valid(self, context, output):
            valid = self._now.Eval(context).age <= self._maximum_age
            output.SetFromVector([T(float(valid))])

    return Impl


SourceTracker = SourceTracker_[None]
