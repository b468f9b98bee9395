"""Knows where the source is, from the estimates that are heard of it."""

from __future__ import annotations

from dataclasses import replace

from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import read_arrays
from systems.framework.input_error import InputError
from systems.framework.scalar_math import float_of
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S, whole
from systems.hearing.parameters import TrackerParameters
from systems.hearing.tracking.tracker_model import Measurement, Track, TrackerModel

#: An older estimate would be placed by a pose that nobody remembers, s.
_OLDEST_S = 2.0


@define_for_scalars("SourceTracker_", __name__)
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

        A Kalman filter in W (``systems.hearing.tracking.target_filter``). A new
        estimate is placed by the odometry pose of the moment it was measured,
        ``measurement_age_s`` ago; one without range counts across its bearing
        alone. An estimate that no source can have reached is dropped, unless
        several in a row agree. Between bursts the target rests in W, moves with
        the robot, or goes on with its velocity, as ``hold`` says; the
        covariance counts where it would be expected instead. Nothing heard yet,
        or a target older than ``maximum_age_s``: ``target_valid`` is 0, and the
        controllers stop the robot.

        Discrete state, every tick: ``Track``, and where hearing is slower than the
        tick, ticks since the last frame. The outputs continue it by the present
        estimate: no latency. A slower hearing's estimate counts once, at the tick
        after the one at which its frame ends.

        Args:
            robot: Place of P, and microphones.
            tracker: ``TrackerParameters``.
            measurement_age_s: From the moment an estimate is valid for to its
                arrival, s, at most 2 s: a tick for the ideal sensor, a tick
                and half a frame for the audio chain.
            frame_s: Period of the estimates, s.
            tick_s: Period of the robot, s.

        Raises:
            InputError: The age cannot be, or the estimates' period is no multiple of
                the tick.
        """

        FACTS = BlockFacts(
            "tracker",
            "control",
            columns={
                "p_WS_estimated": ("p_WS_estimated_x", "p_WS_estimated_y"),
                "target_valid": ("target_valid",),
            },
        )

        def _construct(
            self,
            *,
            robot=None,
            tracker=None,
            measurement_age_s=TICK_S,
            frame_s=TICK_S,
            tick_s=TICK_S,
            converter=None,
        ):
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
            self._config = {
                "robot": robot or RobotParameters(),
                "tracker": tracker or TrackerParameters(),
                "measurement_age_s": measurement_age_s,
                "tick_s": tick_s,
            }
            self._model = TrackerModel(**self._config)
            self._config["frame_s"] = frame_s
            self._frame_ticks = round(frame_s / tick_s)
            self._maximum_age = self._config["tracker"].maximum_age_s
            self.set_name("source_tracker")
            self._inputs = [
                self.DeclareVectorInputPort(name=name, size=size)
                for name, size in (
                    ("p_PS_B", 2),
                    ("covariance", 4),
                    ("detected", 1),
                    ("range_valid", 1),
                    ("pose_WB_estimated", 3),
                )
            ]
            blank = self._model.start([0.0] * 3)
            self.DeclareDiscreteState([T(value) for value in blank.pack()])
            states = blank.names()
            if self._frame_ticks > 1:
                self.DeclareDiscreteState([T(0.0)])
                states += ("ticks_of_frame",)
            self.FACTS = replace(self.FACTS, states=states)
            self.DeclareInitializationDiscreteUpdateEvent(update=self._start)
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=tick_s, offset_sec=0.0, update=self._update
            )
            sources = {port.ticket() for port in self._inputs}
            sources.add(self.xd_ticket())
            self._now = declare_cache(self, "track and pose", self._track, sources)
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
                    prerequisites_of_calc={self._now.ticket()},
                )

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, **other._config, converter=converter)

        def step_for(self, run):
            """What the block does in each tick of a compiled loop, ``Step``."""
            pose = run.initial_pose
            return self._model.step(pose, self._frame_ticks, self._maximum_age)

        def _start(self, context, discrete_state):
            track = self._model.start(*read_arrays(context, self._inputs[-1:]))
            discrete_state.set_value(0, track.pack())

        def _is_new(self, context):
            """Whether the estimate is that of a frame that ended at the last tick."""
            if self._frame_ticks == 1:
                return True
            return float_of(context.get_discrete_state(1)[0]) == 1.0

        def _track(self, context):
            """The track with the present estimate folded in, and the robot's pose."""
            values = read_arrays(context, self._inputs)
            p_PS_B, covariance, detected, range_valid, pose = values
            state = context.get_discrete_state(0).CopyToVector()
            track = Track.unpack(state, self._model.past_ticks)
            if detected[0] > 0.5 and self._is_new(context):
                ranged = bool(range_valid[0] > 0.5)
                estimate = Measurement(p_PS_B, covariance, ranged)
                track = self._model.hear(track, estimate, pose)
            return track, pose

        def _update(self, context, discrete_state):
            track = self._model.older(*self._now.Eval(context))
            discrete_state.set_value(0, track.pack())
            if self._frame_ticks > 1:
                ticks = context.get_discrete_state(1)[0] + 1.0
                if float_of(ticks) > self._frame_ticks:
                    ticks -= self._frame_ticks
                discrete_state.set_value(1, [ticks])

        def _target(self, context, output):
            output.SetFromVector(self._model.position(*self._now.Eval(context)))

        def _velocity(self, context, output):
            track, _ = self._now.Eval(context)
            output.SetFromVector(self._model.velocity(track))

        def _target_covariance(self, context, output):
            output.SetFromVector(self._model.covariance(*self._now.Eval(context)))

        def _age(self, context, output):
            track, _ = self._now.Eval(context)
            output.SetFromVector([track.age])

        def _valid(self, context, output):
            track, _ = self._now.Eval(context)
            output.SetFromVector([T(float(track.age <= self._maximum_age))])

    return Impl


SourceTracker = SourceTracker_[None]
