"""Holds the target between bursts and tells front from back by motion."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

from pydantic import Field
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from systems.cache import declare_cache
from systems.front_back import Candidates, resolve
from systems.geometry import control_point, rotate, safe_norm
from systems.parameters import Parameters, Positive
from systems.robot import RobotParameters
from systems.signals import FRAME_PERIOD_S

__all__ = [
    "Estimate",
    "SourceTracker",
    "SourceTracker_",
    "Track",
    "TrackerParameters",
    "fold_estimate",
    "held_target",
    "past_pose",
]

#: Age of a target that was never heard, s: finite, and beyond every limit.
NEVER_HEARD_S = 1e6


class TrackerParameters(Parameters):
    """How the target is held."""

    hold: Literal["world", "robot"] = "world"
    """Between bursts the target rests in W, or moves with the robot."""
    maximum_age_s: Positive = 6.0
    """An older target is lost: three periods of the sound, s."""
    assumed_range_m: Positive = 3.0
    """Range of the first target when only its bearing is known, m."""
    resolve_front_back: bool = True
    """Let the robot's motion tell the source from its mirror image behind the
    microphones; off: every source is in front."""
    source_top_speed_m_s: Positive = 0.5
    """Fastest that a source is believed to move, m/s."""
    jump_m: Positive = 0.3
    """An estimate that is farther from the target than a source can have moved,
    plus this, is an outlier, m."""
    believed_outliers: int = Field(default=3, ge=1)
    """The outlier of this number in a row is believed after all."""
    mirror_tolerance_m: Positive = 0.15
    """Error of a position that says nothing against a candidate, m."""


class Track(NamedTuple):
    """The tracker's memory; floats or AutoDiffXd."""

    pose_1: list[Any]
    """Odometry pose one tick ago."""
    pose_2: list[Any]
    """Odometry pose two ticks ago."""
    held: list[Any]
    """Target in W (hold: world), or from P in B axes (hold: robot), m."""
    covariance: list[Any]
    """Of the target in W, row by row, m^2."""
    age: float
    """Since the measurement behind the target, s."""
    outliers: float
    """How many outliers came in a row."""
    candidates: list[Any]
    """State of the front/back resolver."""

    @classmethod
    def unpack(cls, values: list[Any]) -> Track:
        """From the discrete state's vector."""
        return cls(
            values[0:3],
            values[3:6],
            values[6:8],
            values[8:12],
            values[12],
            values[13],
            values[14:],
        )

    def pack(self) -> list[Any]:
        """To the discrete state's vector."""
        return [
            *self.pose_1,
            *self.pose_2,
            *self.held,
            *self.covariance,
            self.age,
            self.outliers,
            *self.candidates,
        ]


def past_pose(pose_now, pose_1, pose_2, age):
    """Odometry pose ``age`` seconds ago, 0 to 50 ms, between ticks by a line."""
    ticks = age / FRAME_PERIOD_S
    newer, older, part = (
        (pose_now, pose_1, ticks) if ticks <= 1.0 else (pose_1, pose_2, ticks - 1.0)
    )
    return [a + part * (b - a) for a, b in zip(newer, older, strict=True)]


def _covariance_in_world(covariance, theta):
    """R C R^T for a covariance given row by row."""
    a = rotate(theta, covariance[0], covariance[2])
    b = rotate(theta, covariance[1], covariance[3])
    top = rotate(theta, a[0], b[0])
    bottom = rotate(theta, a[1], b[1])
    return [top[0], top[1], bottom[0], bottom[1]]


class Estimate(NamedTuple):
    """What a hearing block says; floats or AutoDiffXd."""

    p_PS_B: list[Any]
    """Source from P, m; a unit vector where only the bearing is known."""
    covariance: list[Any]
    """Of p_PS_B, row by row, m^2."""
    ranged: bool
    """Whether the range is known."""


def fold_estimate(
    track: Track,
    estimate: Estimate,
    pose: list[Any],
    tracker: TrackerParameters,
    control_point_m: float,
) -> Track | None:
    """The track with a new estimate folded in.

    Args:
        track: The memory.
        estimate: The estimate.
        pose: Odometry pose of the moment that the estimate is valid for.
        tracker: How the target is held.
        control_point_m: Distance of P ahead of the axle, m.

    Returns:
        The new memory, whose age is still the old one; or, where the estimate
        is an outlier, None.
    """
    x_P, y_P = control_point(pose, control_point_m)
    x, y = estimate.p_PS_B
    candidates, covariance = track.candidates, estimate.covariance
    if not estimate.ranged:
        kept = _kept_range(track, x_P, y_P, tracker)
        x, y = x * kept, y * kept
        # Across the bearing only: nothing is known of the error of a kept range.
        covariance = [kept * kept * value for value in covariance]
    dx, dy = rotate(pose[2], x, y)
    target = [x_P + dx, y_P + dy]
    dx, dy = rotate(pose[2], -x, y)
    mirrored = [x_P + dx, y_P + dy]
    places = [target, mirrored] if tracker.resolve_front_back else [target]
    if _is_outlier(track, places, (x_P, y_P, pose[2]), tracker):
        return None
    if tracker.resolve_front_back:
        if estimate.ranged:
            candidates, target = resolve(candidates, target, mirrored, tracker)
        elif Candidates.behind(candidates):
            target = mirrored
        if target is mirrored:
            covariance = [covariance[0], -covariance[1], -covariance[2], covariance[3]]
    if tracker.hold == "robot":
        target = list(rotate(-pose[2], target[0] - x_P, target[1] - y_P))
    return track._replace(
        held=list(target),
        outliers=0.0,
        covariance=_covariance_in_world(covariance, pose[2]),
        candidates=candidates,
    )


def _is_outlier(track: Track, places, p_WP, tracker: TrackerParameters) -> bool:
    """Whether none of the places can be where the target has moved to.

    Single frames of speech or of a cut burst can be metres off with a small
    stated error; a target that really jumps is believed after a few frames.
    """
    if track.age >= NEVER_HEARD_S or track.outliers + 1 >= tracker.believed_outliers:
        return False
    x, y = track.held
    if tracker.hold == "robot":
        dx, dy = rotate(p_WP[2], x, y)
        x, y = p_WP[0] + dx, p_WP[1] + dy
    reach = tracker.jump_m + tracker.source_top_speed_m_s * track.age
    return all(safe_norm(a - x, b - y) > reach for a, b in places)


def _kept_range(track: Track, x_P, y_P, tracker: TrackerParameters):
    """Range to use with a bearing alone, m."""
    if track.age >= NEVER_HEARD_S:
        return tracker.assumed_range_m
    if tracker.hold == "robot":
        return safe_norm(*track.held)
    return safe_norm(track.held[0] - x_P, track.held[1] - y_P)


def held_target(track: Track, pose, tracker: TrackerParameters, control_point_m):
    """The target in W as it stands for a robot at ``pose``, m."""
    if tracker.hold == "world":
        return track.held
    x_P, y_P = control_point(pose, control_point_m)
    dx, dy = rotate(pose[2], *track.held)
    return [x_P + dx, y_P + dy]


@TemplateSystem.define("SourceTracker_", T_list=[float, AutoDiffXd])
def SourceTracker_(T):
    class Impl(LeafSystem_[T]):
        """Keeps the target where the source was last heard.

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
            - covariance_W [m^2, row by row]
            - age [s]
            - target_valid [0 or 1]

        A new estimate is placed by the odometry pose of the moment it was
        measured, ``measurement_age_s`` ago. Where only the bearing is known,
        the last range is kept. An estimate that no source can have reached is
        dropped, unless several in a row say so. Between bursts the target rests
        in W (or, with ``hold: robot``, moves with the robot). Nothing heard yet,
        or a target older than ``maximum_age_s``: ``target_valid`` is 0, and the
        controllers stop the robot.

        Discrete state, 25 ms: ``Track``. The outputs continue it by the
        present estimate: no latency.

        Args:
            robot: Place of P.
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
            self._robot = robot or RobotParameters()
            self._tracker = tracker or TrackerParameters()
            if not 0.0 <= measurement_age_s <= 2.0 * FRAME_PERIOD_S:
                raise ValueError(
                    f"SourceTracker: measurement_age_s is {measurement_age_s}; it "
                    f"must lie between 0 and {2.0 * FRAME_PERIOD_S}"
                )
            self._measurement_age = measurement_age_s
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
            blank = Track(
                [0.0] * 3,
                [0.0] * 3,
                [0.0] * 2,
                [0.0] * 4,
                NEVER_HEARD_S,
                0.0,
                Candidates.none(),
            )
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
                ("covariance_W", 4, self._target_covariance),
                ("age", 1, self._age),
                ("target_valid", 1, self._valid),
            ):
                self.DeclareVectorOutputPort(
                    name=name,
                    size=size,
                    calc=calc,
                    prerequisites_of_calc={self._now.ticket()},
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(
                self,
                robot=other._robot,
                tracker=other._tracker,
                measurement_age_s=other._measurement_age,
                converter=converter,
            )

        def _start(self, context, discrete_state):
            """Before time zero the robot was where it starts."""
            pose = self._pose.Eval(context)
            discrete_state.get_mutable_vector().SetFromVector(
                [*pose, *pose, *self._state(context)[6:]]
            )

        def _state(self, context):
            return context.get_discrete_state(0).CopyToVector().tolist()

        def _track(self, context):
            """(Track with the present estimate folded in, target in W, pose)."""
            track = Track.unpack(self._state(context))
            pose = self._pose.Eval(context).tolist()
            epsilon = self._robot.control_point_m
            if self._detected.Eval(context)[0] > 0.5:
                estimate = Estimate(
                    self._p_PS_B.Eval(context).tolist(),
                    self._covariance.Eval(context).tolist(),
                    bool(self._range_valid.Eval(context)[0] > 0.5),
                )
                then = past_pose(
                    pose, track.pose_1, track.pose_2, self._measurement_age
                )
                folded = fold_estimate(track, estimate, then, self._tracker, epsilon)
                if folded is None:
                    track = track._replace(outliers=track.outliers + 1.0)
                else:
                    track = folded._replace(age=T(self._measurement_age))
            return track, held_target(track, pose, self._tracker, epsilon), pose

        def _update(self, context, discrete_state):
            track, _, pose = self._now.Eval(context)
            age = track.age
            if age < NEVER_HEARD_S:
                age = age + FRAME_PERIOD_S
            older = Track(
                pose,
                track.pose_1,
                track.held,
                track.covariance,
                age,
                track.outliers,
                Candidates.older(track.candidates, FRAME_PERIOD_S),
            )
            discrete_state.get_mutable_vector().SetFromVector(older.pack())

        def _target(self, context, output):
            output.SetFromVector(self._now.Eval(context)[1])

        def _target_covariance(self, context, output):
            output.SetFromVector(self._now.Eval(context)[0].covariance)

        def _age(self, context, output):
            output.SetFromVector([self._now.Eval(context)[0].age])

        def _valid(self, context, output):
            age = self._now.Eval(context)[0].age
            valid = 1.0 if age <= self._tracker.maximum_age_s else 0.0
            output.SetFromVector([T(valid)])

    return Impl


SourceTracker = SourceTracker_[None]
