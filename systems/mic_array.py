"""The robot's microphones, with their converter."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, LeafSystem

from systems.acoustics import AcousticParameters
from systems.adc import MicArrayParameters, channel_skew, convert, frame_noise
from systems.array_tolerances import Tolerances, draw_tolerances
from systems.cache import declare_cache
from systems.noise import BEFORE_THE_RUN, tick_generator
from systems.propagation import microphone_paths, propagate
from systems.robot import RobotParameters
from systems.signals import FRAME_PERIOD_S, SAMPLE_RATE_HZ, AudioFrame, Emission

__all__ = [
    "FRAME_SAMPLES",
    "MicArray",
    "MicArrayParameters",
    "RealArray",
    "microphones_B",
    "real_array",
    "record_frame",
]

#: Samples a channel in a frame.
FRAME_SAMPLES = round(FRAME_PERIOD_S * SAMPLE_RATE_HZ)

# Spacing of 2.5 ms: even a robot that spins at 4 rad/s bends the delay by
# less than 1e-4 sample from a cubic in that time.
_KNOTS = 11

# Two instants closer than this are one tick of a 25 ms clock, s.
_SAME_INSTANT_S = 1e-6


def microphones_B(robot: RobotParameters) -> NDArray[np.float64]:
    """(n, 2) microphones in B, m, in the order of the channels."""
    return np.add(robot.microphones_m, [robot.control_point_m, 0.0])


class RealArray(NamedTuple):
    """The array and the air as they are, whatever they are thought to be."""

    p_BM: NDArray[np.float64]
    """(n, 2) microphones in B, m."""
    instants: NDArray[np.float64]
    """(n, knots) of each channel's knots from the frame's start, s."""
    gains: NDArray[np.float64]
    """(n,) true over stated gain of each channel."""
    c: float
    """Speed of sound, m/s."""


def real_array(
    robot: RobotParameters,
    parameters: MicArrayParameters,
    tolerances: Tolerances,
    c: float,
) -> RealArray:
    """The array with its errors.

    Args:
        robot: Stated places of the microphones.
        parameters: Stated skew of the channels.
        tolerances: The errors of both, and of the gains.
        c: Speed of sound, m/s.

    Raises:
        ValueError: The skew is given for another number of channels.
    """
    p_BM = microphones_B(robot) + tolerances.position_errors
    late = channel_skew(parameters, len(p_BM)) + tolerances.channel_delays
    knots = np.linspace(0.0, FRAME_PERIOD_S, _KNOTS)
    return RealArray(p_BM, knots + late[:, None], tolerances.gains, c)


def record_frame(
    emission: Emission,
    time: float,
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
    now: tuple[NDArray[np.float64], NDArray[np.float64]],
    array: RealArray,
    *,
    parameters: MicArrayParameters,
    seed: int,
) -> AudioFrame:
    """The frame that ends now.

    Args:
        emission: What has left the source.
        time: Now, s.
        before: Pose and velocity of the robot a frame ago, (3,) each.
        now: Pose and velocity of the robot now.
        array: From ``real_array``.
        parameters: Microphones, amplifier and converter.
        seed: Seed of the noise.

    Raises:
        ValueError: The source is out of the emission's reach.
    """
    begin = time - FRAME_PERIOD_S
    times = begin + array.instants
    p_WM, v_WM = microphone_paths(times, begin, *before, time, *now, array.p_BM)
    pressure = propagate(emission, times, p_WM, v_WM, FRAME_SAMPLES, array.c)
    tick = round(time / FRAME_PERIOD_S)
    noise = frame_noise((len(p_WM), FRAME_SAMPLES), seed, tick)
    noise_pa = emission.level_pa * 10.0 ** (-parameters.snr_db_at_1m / 20.0)
    return AudioFrame(
        counts=convert(pressure, noise, noise_pa, parameters, array.gains),
        full_scale=parameters.full_scale,
        sample_rate_hz=SAMPLE_RATE_HZ,
        time=time,
    )


class MicArray(LeafSystem):
    """Records the sound at the robot's microphones.

    .. pydrake_system::

        name: MicArray
        input_ports:
        - emission [Emission]
        - pose_WB [m, m, rad]
        - velocity_WB [m/s, m/s, rad/s]
        output_ports:
        - audio [AudioFrame]

    A frame published at t covers [t - 25 ms, t). Between the two ticks the
    robot follows a cubic Hermite polynomial; sound travels as in
    ``systems.propagation``. A robot that has no tick behind it, or is read
    between two ticks, is taken to have come at its present velocity.

    Numeric parameters, by the class's constants of these names; a trial may
    set them in its context, at the latest before the first tick:
    ``POSITION_ERRORS`` (2 n, x and y of one microphone after the other, m),
    ``CHANNEL_DELAYS`` (n, s) and ``GAINS`` (n, 1 is none), as in
    ``systems.array_tolerances``; ``SOUND_SPEED`` (1, m/s), of the air. Their
    defaults are drawn from the seed, within the tolerances of the parameters.

    State: time, pose and velocity of the robot at the last tick.
    Rate and latency: a function of the state and the present inputs; no
    latency. The state is updated every 25 ms.

    Args:
        parameters: Microphones, amplifier and converter.
        robot: Places of the microphones.
        acoustics: Speed of sound.
        seed: Seed of the noise and of the array's errors.

    Raises:
        ValueError: The skew is given for another number of channels.
    """

    POSITION_ERRORS, CHANNEL_DELAYS, GAINS, SOUND_SPEED = range(4)

    def __init__(
        self,
        *,
        parameters: MicArrayParameters | None = None,
        robot: RobotParameters | None = None,
        acoustics: AcousticParameters | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self._parameters = parameters or MicArrayParameters()
        self._robot = robot or RobotParameters()
        self._seed = seed
        self.set_name("mic_array")
        self._declare_errors((acoustics or AcousticParameters()).c)
        self._emission = self.DeclareAbstractInputPort(
            name="emission", model_value=Value(object())
        )
        self._pose_WB = self.DeclareVectorInputPort(name="pose_WB", size=3)
        self._velocity_WB = self.DeclareVectorInputPort(name="velocity_WB", size=3)
        self.DeclareDiscreteState(np.r_[-np.inf, np.zeros(6)])
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=FRAME_PERIOD_S, offset_sec=0.0, update=self._remember
        )
        self.DeclareAbstractOutputPort(
            name="audio",
            alloc=lambda: Value(object()),
            calc=self._record,
            prerequisites_of_calc={
                self.time_ticket(),
                self.xd_ticket(),
                self._array.ticket(),
                self._emission.ticket(),
                self._pose_WB.ticket(),
                self._velocity_WB.ticket(),
            },
        )

    def _declare_errors(self, c: float) -> None:
        drawn = draw_tolerances(
            self._parameters,
            len(self._robot.microphones_m),
            tick_generator(self._seed, BEFORE_THE_RUN),
        )
        real_array(self._robot, self._parameters, drawn, c)  # refuses bad skews
        # In the order of the constants' numbers.
        groups: Any = (
            drawn.position_errors.ravel(),
            drawn.channel_delays,
            drawn.gains,
            np.array([c]),
        )
        for values in groups:
            self.DeclareNumericParameter(BasicVector(values))
        self._array = declare_cache(
            self,
            "array with its errors",
            self._build_array,
            {self.all_parameters_ticket()},
        )

    def _build_array(self, context) -> RealArray:
        positions, delays, gains, (c,) = (
            context.get_numeric_parameter(index).CopyToVector()
            for index in range(context.num_numeric_parameter_groups())
        )
        tolerances = Tolerances(positions.reshape(-1, 2), delays, gains)
        return real_array(self._robot, self._parameters, tolerances, float(c))

    def _remember(self, context, discrete_state):
        state = np.empty(7)
        state[0] = context.get_time()
        state[1:4] = self._pose_WB.Eval(context)
        state[4:] = self._velocity_WB.Eval(context)
        discrete_state.set_value(state)

    def _record(self, context, output) -> None:
        emission = self._emission.Eval(context)
        if not isinstance(emission, Emission):
            raise TypeError(
                f"MicArray: port emission carries a {type(emission).__name__}; "
                "connect the emission of a SoundEmitter"
            )
        time = context.get_time()
        pose = np.asarray(self._pose_WB.Eval(context))
        velocity = np.asarray(self._velocity_WB.Eval(context))
        array: Any = self._array.Eval(context)
        last = context.get_discrete_state_vector().value()
        before = last[1:4], last[4:7]
        if abs(last[0] - (time - FRAME_PERIOD_S)) > _SAME_INSTANT_S:
            before = pose - FRAME_PERIOD_S * velocity, velocity
        output.set_value(
            record_frame(
                emission,
                time,
                before,
                (pose, velocity),
                array,
                parameters=self._parameters,
                seed=self._seed,
            )
        )
