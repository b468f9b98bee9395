"""Exact hearing in place of loudspeaker, microphones and estimator."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray
from pydrake.math import atan2
from pydrake.systems.framework import LeafSystem_

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.finite import read_lists
from systems.framework.input_error import InputError
from systems.framework.noise import tick_generator
from systems.framework.scalar_math import cos, sin
from systems.framework.scalar_types import define_for_scalars
from systems.framework.signals import TICK_S
from systems.framework.step_block import Step
from systems.hearing.parameters import IdealHearingParameters
from systems.sound.parameters import SoundParameters
from systems.world.geometry import control_point, rotate, safe_norm


@register_jitable
def relative_position(pose_WB: Any, pose_WS: Any, control_point_m: Any) -> Any:
    """The source as seen from the robot; floats or AutoDiffXd.

    Args:
        pose_WB: x, y, theta of the robot, m and rad.
        pose_WS: x, y, theta of the source; its heading does not count.
        control_point_m: Distance of P ahead of the origin of B, m.

    Returns:
        x and y of p_PS_B, the source from P in B axes, m.
    """
    x_P, y_P = control_point(pose_WB, control_point_m)
    return rotate(-pose_WB[2], pose_WS[0] - x_P, pose_WS[1] - y_P)


@register_jitable
def disturbed(x: Any, y: Any, numbers: Any, hearing: Any) -> Any:
    """A position with the noise of bearing and range.

    Args:
        x: Of p_PS_B, m.
        y: The same, m.
        numbers: Two standard normal numbers.
        hearing: ``IdealHearingParameters``.

    Returns:
        x and y, m.
    """
    bearing = math.atan2(y, x) + numbers[0] * math.radians(hearing.bearing_noise_deg)
    factor = 1.0 + numbers[1] * hearing.range_noise_fraction
    distance = math.sqrt(x * x + y * y) * max(factor, 0.0)
    return distance * math.cos(bearing), distance * math.sin(bearing)


@register_jitable
def stated_covariance(x: Any, y: Any, hearing: Any) -> Any:
    """Covariance of a position for the noise that is set, row by row, m^2.

    Args:
        x: Of p_PS_B, m; float or AutoDiffXd.
        y: The same, m.
        hearing: ``IdealHearingParameters``.

    Returns:
        xx, xy, yx, yy, m^2.
    """
    bearing = atan2(y, x)
    across = math.radians(hearing.bearing_noise_deg) ** 2 * (x * x + y * y)
    along = hearing.range_noise_fraction**2 * (x * x + y * y)
    c, s = cos(bearing), sin(bearing)
    mixed = (along - across) * c * s
    return (
        along * c * c + across * s * s,
        mixed,
        mixed,
        along * s * s + across * c * c,
    )


class IdealSourceNumbers(NamedTuple):
    """What the step of ``IdealSourceSensor`` depends on."""

    control_point_m: float
    """Distance of P ahead of the axle, m."""
    hearing: IdealHearingParameters
    frame_ticks: int
    """Ticks from one measurement to the next."""
    sounds: NDArray[np.bool_]
    """(n,) whether there is sound, by number of the measurement."""
    noise: NDArray[np.float64]
    """(n, 2) standard normal numbers likewise; (0, 2) without noise."""


def ideal_source_step(
    tick: Any, state: Any, inputs: Any, outputs: Any, numbers: Any
) -> None:
    """What is heard at one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: x and y of p_PS_B, m, and whether anything is heard.
        inputs: As the input ports.
        outputs: Left as they are: they follow from the state.
        numbers: ``IdealSourceNumbers``.
    """
    if tick % numbers.frame_ticks != 0:
        return
    frame = tick // numbers.frame_ticks
    pose_WB, pose_WS = inputs
    hearing = numbers.hearing
    x, y = relative_position(pose_WB, pose_WS, numbers.control_point_m)
    heard = numbers.sounds[frame] and safe_norm(x, y) <= hearing.maximum_range_m
    if len(numbers.noise) > 0:
        x, y = disturbed(x, y, numbers.noise[frame], hearing)
    state[0], state[1], state[2] = 0.0, 0.0, 0.0
    if heard:
        state[0], state[1], state[2] = x, y, 1.0


def _publish_ideal_source(state, outputs, numbers):
    """The outputs of ``ideal_source_step``'s state."""
    bearing, distance, p_PS_B, covariance, detected, range_valid = outputs
    x, y = state[0], state[1]
    bearing[0], distance[0] = math.atan2(y, x), safe_norm(x, y)
    p_PS_B[0], p_PS_B[1] = x, y
    stated = stated_covariance(x, y, numbers.hearing)
    for k in range(4):
        covariance[k] = stated[k]
    detected[0] = range_valid[0] = state[2]


@define_for_scalars("IdealSourceSensor_", __name__)
def IdealSourceSensor_(T):
    class Impl(LeafSystem_[T]):
        """Measures where the source is, exactly or with a set noise.

        .. pydrake_system::

            name: IdealSourceSensor
            input_ports:
            - pose_WB [m, m, rad]
            - pose_WS [m, m, rad]
            output_ports:
            - source_bearing [rad]
            - source_range [m]
            - p_PS_B [m]
            - covariance [m^2, of p_PS_B, row by row]
            - detected [0 or 1]
            - range_valid [0 or 1]

        Stands in for ``SoundEmitter``, ``MicArray`` and ``TDOAEstimator`` with
        the outputs of the last. Discrete state, every frame: p_PS_B and detected.
        Latency one tick, like the estimator's, so that both builds have the
        same loop; unlike the estimator it tells front from back.

        Args:
            robot: Place of P.
            hearing: ``IdealHearingParameters``.
            sound: ``SoundParameters``; its gate says when there is sound.
            frame_s: Period of the measurements, s.
            seed: Seed of the noise.

        Raises:
            InputError: Noise is set in an AutoDiffXd system.
        """

        FACTS = BlockFacts(
            "hearing",
            "hearing",
            columns={
                "p_PS_B": ("p_PS_B_x", "p_PS_B_y"),
                "detected": ("detected",),
                "range_valid": ("range_valid",),
            },
            states=("p_PS_B_x", "p_PS_B_y", "detected"),
        )

        def _construct(
            self,
            *,
            robot=None,
            hearing=None,
            sound=None,
            frame_s=TICK_S,
            seed=0,
            converter=None,
        ):
            super().__init__(converter=converter)
            self._config = {
                "robot": robot or RobotParameters(),
                "hearing": hearing or IdealHearingParameters(),
                "sound": sound or SoundParameters(),
                "frame_s": frame_s,
                "seed": seed,
            }
            self._hearing = self._config["hearing"]
            self._noisy = (
                self._hearing.bearing_noise_deg > 0.0
                or self._hearing.range_noise_fraction > 0.0
            )
            if self._noisy and T is not float:
                raise InputError(
                    "IdealSourceSensor",
                    "noise is set, and noise has no derivative; "
                    "set bearing_noise_deg and range_noise_fraction to 0",
                )
            self.set_name("ideal_source_sensor")
            self._poses = [
                self.DeclareVectorInputPort(name=name, size=3)
                for name in ("pose_WB", "pose_WS")
            ]
            self._position = self.DeclareDiscreteState(2)
            self._detected = self.DeclareDiscreteState(1)
            self.DeclarePeriodicDiscreteUpdateEvent(
                period_sec=frame_s, offset_sec=0.0, update=self._measure
            )
            self._declare("source_bearing", 1, self._bearing)
            self._declare("source_range", 1, self._range)
            self.DeclareStateOutputPort("p_PS_B", self._position)
            self._declare(
                "covariance",
                4,
                self._covariance,
                self.xd_ticket(),
            )
            self.DeclareStateOutputPort("detected", self._detected)
            self.DeclareStateOutputPort("range_valid", self._detected)

        def _construct_copy(self, other, converter=None):
            Impl._construct(self, **other._config, converter=converter)

        def _declare(self, name, size, calc, ticket=None):
            self.DeclareVectorOutputPort(
                name=name,
                size=size,
                calc=calc,
                prerequisites_of_calc={ticket or self.xd_ticket()},
            )

        def _state(self, context):
            return context.get_discrete_state(self._position).CopyToVector().tolist()

        def _sounds(self, time: float) -> bool:
            return not self._hearing.burst_gaps or self._config["sound"].sounds(time)

        def _measure(self, context, discrete_state):
            x, y = relative_position(
                *read_lists(context, self._poses),
                self._config["robot"].control_point_m,
            )
            time = context.get_time()
            time = time if T is float else time.value()
            frame_s = self._config["frame_s"]
            heard = self._sounds(time - frame_s / 2.0) and bool(
                safe_norm(x, y) <= self._hearing.maximum_range_m
            )
            if self._noisy:
                x, y = self._disturbed(x, y, round(time / frame_s))
            if not heard:
                x = y = T(0.0)
            discrete_state.set_value(self._position, [x, y])
            discrete_state.set_value(self._detected, [T(float(heard))])

        def _disturbed(self, x, y, frame):
            rng = tick_generator(self._config["seed"], frame)
            return disturbed(x, y, rng.standard_normal(2).tolist(), self._hearing)

        def step_for(self, run):
            """What the block does in each tick of a compiled loop, ``Step``."""
            frame_s, seed = self._config["frame_s"], run.seed_of(self.get_name())
            frames = np.arange(math.ceil((run.ticks + 1) * run.tick_s / frame_s) + 1)
            sounds = np.ones(len(frames), dtype=bool)
            if self._hearing.burst_gaps:
                sounds = self._config["sound"].sounds((frames - 0.5) * frame_s)
            noise = np.empty((0, 2))
            if self._noisy:
                generators = [tick_generator(seed, k) for k in frames.tolist()]
                noise = np.array([rng.standard_normal(2) for rng in generators])
            numbers = IdealSourceNumbers(
                self._config["robot"].control_point_m,
                self._hearing,
                round(frame_s / run.tick_s),
                sounds,
                noise,
            )
            return Step(ideal_source_step, numbers, [0.0] * 3, _publish_ideal_source)

        def _bearing(self, context, output):
            x, y = self._state(context)
            output.SetFromVector([atan2(y, x)])

        def _range(self, context, output):
            x, y = self._state(context)
            output.SetFromVector([safe_norm(x, y)])

        def _covariance(self, context, output):
            x, y = self._state(context)
            output.SetFromVector(stated_covariance(x, y, self._hearing))

    return Impl


IdealSourceSensor = IdealSourceSensor_[None]
