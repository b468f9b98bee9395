"""Tracks the source from the estimates of its position."""

from __future__ import annotations

from typing import Any

from systems.base.robot import RobotParameters
from systems.framework.block import Block_, Port, RunFacts, Step
from systems.framework.input_error import InputError
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S, whole
from systems.hearing.parameters import TrackerParameters
from systems.hearing.tracking.tracker_model import (
    MEASUREMENT_FLOOR_M,
    blank_track,
    track_names,
    track_step,
    tracker_numbers,
)

#: Largest age of an estimate on arrival, s. The number of stored poses grows with it.
_OLDEST_S = 2.0


@define_for_scalars("SourceTracker_", __name__)
def SourceTracker_(T):
    class Impl(Block_[T]):
        """Tracks the position of the sound source during and between its bursts.

        The block contains a Kalman filter in the world frame W
        (``systems.hearing.tracking.target_filter``). Each new estimate of the position
        was measured ``measurement_age_s`` ago. The block converts the estimate to W
        with the odometry pose at the time of the measurement. An estimate without a
        range corrects the position only perpendicular to the bearing. If the source
        cannot have moved to an estimated position, the block rejects the estimate. If
        several consecutive rejected estimates agree with each other, the block accepts
        them nevertheless.

        Between bursts, the position of the target follows one of three rules, which
        ``hold`` selects. The target stays at its place in W, moves with the robot, or
        moves on with its velocity. The covariance includes the distance between the
        target and the expected position of the source.

        The output ``target_valid`` is 0 if nothing was heard yet, or if the source was
        last heard more than ``maximum_age_s`` ago. The controllers then stop the robot.

        The discrete state has the past poses and the tracks, see ``track_step``. The
        block updates the state every control period (tick). The outputs include the
        present estimate, so there is no latency. If the period of the estimates is
        longer than the tick, the block uses each estimate once, one tick after the end
        of its frame.

        Args:
            robot: Distance of the control point P ahead of the axle, and microphones.
            tracker: Rule and time limit for the target between bursts.
            measurement_age_s: Time from a measurement to the arrival of its estimate,
                s, at most 2 s. For the ideal sensor, it is one tick. For the audio
                chain, it is one tick and half a frame.
            frame_s: Period of the estimates, s.
            exact: Whether the estimates are those of ideal hearing. Such estimates have
                no mirror image, and all their errors are in their covariance.
            initial_pose: (x, y, theta) before time zero, m and rad.
            tick_s: Control period of the robot, s.

        Raises:
            InputError: The age is out of range, or the period of the estimates is no
                multiple of the tick.
        """

        part = "tracker"
        inputs = (
            Port("p_PS_B", 2, "m"),
            Port("covariance", 4, "m^2, of p_PS_B, row by row"),
            Port("detected", 1, "0 or 1"),
            Port("range_valid", 1, "0 or 1"),
            Port("pose_WB_estimated", 3, "m, m, rad"),
        )
        outputs = (
            Port("p_WS_estimated", 2, "m", ("p_WS_estimated_x", "p_WS_estimated_y")),
            Port("v_WS_estimated", 2, "m/s"),
            Port("covariance_W", 4, "m^2, row by row"),
            Port("age", 1, "s"),
            Port("target_valid", 1, "0 or 1", "target_valid"),
        )

        def _construct(
            self,
            *,
            robot: RobotParameters = RobotParameters(),
            tracker: TrackerParameters = TrackerParameters(),
            measurement_age_s: float = TICK_S,
            frame_s: float = TICK_S,
            exact: bool = False,
            initial_pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
            tick_s: float = TICK_S,
            converter: Any = None,
        ) -> None:
            super().__init__(converter=converter)
            if not 0.0 <= measurement_age_s <= _OLDEST_S:
                raise InputError(
                    "SourceTracker",
                    f"measurement_age_s is {measurement_age_s}; it "
                    f"must lie between 0 and {_OLDEST_S}",
                )
            if not whole(frame_s / tick_s):
                raise InputError(
                    "SourceTracker",
                    f"frame_s is {frame_s:g}, not a multiple of tick_s "
                    f"{tick_s:g}; give a multiple",
                )
            self.set_name("source_tracker")
            numbers = tracker_numbers(
                tracker,
                robot,
                measurement_age_s,
                frame_s=frame_s,
                tick_s=tick_s,
                resolve_front_back=not exact,
                floor_m=0.0 if exact else MEASUREMENT_FLOOR_M,
            )
            self.states = track_names(numbers)
            state = blank_track(numbers, initial_pose).tolist()
            self.declare(Step(track_step, numbers, state), tick_s=tick_s, arrays=True)

        def step_for(self, run: RunFacts) -> Step:
            """Returns the step with the initial pose of the run."""
            state = blank_track(self.step.numbers, run.initial_pose).tolist()
            return super().step_for(run)._replace(state=state)

    return Impl


SourceTracker = SourceTracker_[None]
