"""The robot's microphones, with their converter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import check_finite, check_record, read_arrays
from systems.framework.noise import BEFORE_THE_RUN, frame_noise, tick_generator
from systems.framework.signals import (
    SAMPLE_RATE_HZ,
    AudioFrame,
    Emission,
    read_only,
)
from systems.sound.acoustics import AcousticParameters
from systems.sound.adc import MicArrayParameters, convert
from systems.sound.array_tolerances import (
    RealArray,
    Tolerances,
    draw_tolerances,
    real_array,
)
from systems.sound.ego_noise import EgoNoise, driving_share
from systems.sound.propagation import check_reach, microphone_paths, propagate
from systems.sound.reverberation import Reverberation
from systems.sound.room import RoomParameters, room_images
from systems.sound.sound_emitter import MAXIMUM_RANGE_M

__all__ = [
    "MicArray",
    "MicArrayParameters",
    "microphone_reach",
    "microphones_B",
    "record_frame",
]

# Two instants closer than this are one tick of the clock, s.
_SAME_INSTANT_S = 1e-6


def microphones_B(robot: RobotParameters) -> NDArray[np.float64]:
    """(n, 2) microphones in B, m, in the order of the channels."""
    return np.add(robot.microphones_m, [robot.control_point_m, 0.0])


def microphone_reach(
    room: RoomParameters | None, acoustics: AcousticParameters
) -> float:
    """Longest way of sound that emissions must reach back for, m.

    Args:
        room: Its reflections are heard, too; none: the free field.
        acoustics: Speed of sound.

    Returns:
        m, at least MAXIMUM_RANGE_M.
    """
    if room is None:
        return MAXIMUM_RANGE_M
    c = acoustics.c
    return max(MAXIMUM_RANGE_M, room_images(room, c).length / SAMPLE_RATE_HZ * c)


def record_frame(
    emissions: Sequence[Emission],
    time: float,
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
    now: tuple[NDArray[np.float64], NDArray[np.float64]],
    array: RealArray,
    *,
    parameters: MicArrayParameters,
    seed: int,
    rise: float = 0.0,
    reflections: Sequence[NDArray[np.float32] | None] = (),
    ego_noise: NDArray[np.float32] | None = None,
) -> AudioFrame:
    """The frame that ends now.

    Args:
        emissions: What has left the sources; noise refers to the first one.
        time: Now, s.
        before: Pose and velocity of the robot a frame ago, (3,) each.
        now: Pose and velocity of the robot now.
        array: From ``real_array``.
        parameters: Microphones, amplifier, converter and length of the frame.
        seed: Seed of the noise.
        rise: Height of the microphones above the sources, m.
        reflections: (n, samples) Pa each, of the sources' reflections.
        ego_noise: (n, samples) over the level of the first source at 1 m.

    Returns:
        (n, samples) counts, with their full scale, rate and time.

    Raises:
        ValueError: A source is out of the emission's reach.
    """
    direct = _direct_sound(emissions, time, before, now, array, parameters, rise)
    pressure = _total([*direct, *reflections])
    number = round(time / parameters.frame_s)
    noise = frame_noise((len(array.p_BM), parameters.frame_samples), seed, number)
    snr = 10.0 ** (parameters.snr_db_at_1m / 20.0)
    if ego_noise is not None:
        noise += np.float32(snr) * ego_noise
    noise_pa = emissions[0].level_pa / snr
    counts = convert(pressure, noise, noise_pa, parameters, array.gains)
    read_only(counts)
    return AudioFrame(
        counts=counts,
        full_scale=parameters.full_scale,
        sample_rate_hz=parameters.sample_rate_hz,
        time=time,
    )


def _direct_sound(
    emissions: Sequence[Emission],
    time: float,
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
    now: tuple[NDArray[np.float64], NDArray[np.float64]],
    array: RealArray,
    parameters: MicArrayParameters,
    rise: float,
) -> list[NDArray[np.float32]]:
    """(n, samples) Pa of each source that sounds."""
    begin = time - parameters.frame_s
    sounding = [emission for emission in emissions if emission.sounding]
    for emission in emissions:
        if not emission.sounding:  # the robot's place is good enough for silence
            check_reach(emission, begin, before[0][:2], array.c)
    if not sounding:
        return []
    times = begin + array.instants
    p_WM, v_WM = microphone_paths(times, begin, *before, time, *now, array.p_BM)
    arriving = (times, p_WM, v_WM, parameters.frame_samples, array.c, rise)
    return [propagate(emission, *arriving) for emission in sounding]


def _total(
    pressures: Sequence[NDArray[np.float32] | None],
) -> NDArray[np.float32] | None:
    """Their sum, in the place of the first; None where all are silent."""
    heard = [pressure for pressure in pressures if pressure is not None]
    for pressure in heard[1:]:
        heard[0] += pressure
    return heard[0] if heard else None


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

    A frame published at t covers [t - frame_s, t), 25 ms. Within a frame the robot
    follows a cubic Hermite polynomial; sound travels as in
    ``systems.sound.propagation``. A robot that has no frame behind it, or is read
    between two frames' ends, is taken to have come at its present velocity.

    In a room the direct sound is as without one. The reflections are those of
    robot and source at rest where they were at the last multiple of the room's
    ``update_period_s``, so that their geometry is up to that old (and older by
    what sound takes for the way); the frame that ends at such an instant fades
    from the places before to those of that instant.

    Numeric parameters, by the class's constants of these names; a trial may
    set them in its context, at the latest before the first tick:
    ``POSITION_ERRORS`` (2 n, x and y of one microphone after the other, m),
    ``CHANNEL_DELAYS`` (n, s) and ``GAINS`` (n, 1 is none), as in
    ``systems.sound.array_tolerances``; ``SOUND_SPEED`` (1, m/s), of the air. Their
    defaults are drawn from the seed, within the tolerances of the parameters.

    State: time, pose and velocity of the robot at the last frame's end; in a room
    also time, pose of the robot and place of each source at the last update.
    Rate and latency: a function of the state and the present inputs; no
    latency. The state is updated every ``frame_s``.

    Args:
        parameters: Microphones, amplifier and converter.
        robot: Places of the microphones.
        acoustics: Speed of sound.
        room: Walls, if there are any.
        others: Names of further sources, which are not followed; each adds an input
            port ``emission_<name>`` [Emission].
        seed: Seed of the noise and of the array's errors.

    Raises:
        ValueError: The skew is given for another number of channels, the room
            cannot be, or the file of the ego noise cannot be used.
    """

    FACTS = BlockFacts("microphones", "hearing")
    POSITION_ERRORS, CHANNEL_DELAYS, GAINS, SOUND_SPEED = range(4)

    def __init__(
        self,
        *,
        parameters: MicArrayParameters | None = None,
        robot: RobotParameters | None = None,
        acoustics: AcousticParameters | None = None,
        room: RoomParameters | None = None,
        others: Sequence[str] = (),
        seed: int = 0,
    ) -> None:
        super().__init__()
        self._parameters = parameters or MicArrayParameters()
        self._robot = robot or RobotParameters()
        self._seed = seed
        self.set_name("mic_array")
        c = (acoustics or AcousticParameters()).c
        self._declare_errors(c)
        self._reverberation = None
        if room:
            self._reverberation = Reverberation(room, c, self._parameters)
        self._ego_noise = None
        if self._parameters.ego_noise_file is not None:
            count = len(self._robot.microphones_m)
            self._ego_noise = EgoNoise(self._parameters, count, seed)
        self._rise = room.rise_m if room else 0.0
        self._sources = [
            self.DeclareAbstractInputPort(name=name, model_value=Value(object()))
            for name in ("emission", *(f"emission_{name}" for name in others))
        ]
        self._motion = [
            self.DeclareVectorInputPort(name=name, size=3)
            for name in ("pose_WB", "velocity_WB")
        ]
        self.DeclareDiscreteState(np.r_[-np.inf, np.zeros(6)])
        if room:
            self._update_frames = room.update_frames(self._parameters.frame_s)
            self.DeclareDiscreteState(
                np.r_[-np.inf, np.zeros(3 + 2 * len(self._sources))]
            )
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=self._parameters.frame_s, offset_sec=0.0, update=self._remember
        )
        self.DeclareAbstractOutputPort(
            name="audio",
            alloc=lambda: Value(object()),
            calc=self._record,
            prerequisites_of_calc={
                self.time_ticket(),
                self.xd_ticket(),
                self._array.ticket(),
                *(port.ticket() for port in (*self._sources, *self._motion)),
            },
        )

    def _declare_errors(self, c: float) -> None:
        drawn = draw_tolerances(
            self._parameters,
            len(self._robot.microphones_m),
            tick_generator(self._seed, BEFORE_THE_RUN),
        )
        # Refuses a bad skew before anything runs.
        real_array(microphones_B(self._robot), self._parameters, drawn, c)
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

    def _build_array(self, context: Any) -> RealArray:
        groups = [
            context.get_numeric_parameter(index).CopyToVector()
            for index in range(context.num_numeric_parameter_groups())
        ]
        names = "POSITION_ERRORS", "CHANNEL_DELAYS", "GAINS", "SOUND_SPEED"
        for name, values in zip(names, groups, strict=True):
            check_finite(f"MicArray: {name}", values)
        positions, delays, gains, (c,) = groups
        tolerances = Tolerances(positions.reshape(-1, 2), delays, gains)
        p_BM = microphones_B(self._robot)
        return real_array(p_BM, self._parameters, tolerances, float(c))

    def _remember(self, context: Any, discrete_state: Any) -> None:
        state = np.empty(7)
        state[0] = context.get_time()
        state[1:4], state[4:] = read_arrays(context, self._motion)
        discrete_state.set_value(0, state)
        if self._reverberation and self._updates(state[0]):
            places = self._places(state[1:4], self._emissions(context))
            discrete_state.set_value(1, np.r_[state[0], places])

    def _updates(self, time: float) -> bool:
        """Whether reflections take new places at a frame's end."""
        return round(time / self._parameters.frame_s) % self._update_frames == 0

    def _emissions(self, context: Any) -> list[Emission]:
        emissions = []
        for port in self._sources:
            emission: Any = port.Eval(context)
            if not isinstance(emission, Emission):
                raise TypeError(
                    f"MicArray: port {port.get_name()} carries a "
                    f"{type(emission).__name__}; connect the emission of a SoundEmitter"
                )
            check_record(context, port, emission)
            emissions.append(emission)
        return emissions

    def _places(
        self, pose: NDArray[np.float64], emissions: list[Emission]
    ) -> NDArray[np.float64]:
        """Pose of the robot and places of the sources, one after the other."""
        now = [emission.p_WS[-1] for emission in emissions]
        return np.concatenate([pose, *now])

    def _reflections(
        self,
        context: Any,
        pose: NDArray[np.float64],
        emissions: list[Emission],
        array: RealArray,
    ) -> Sequence[NDArray[np.float32] | None]:
        if self._reverberation is None:
            return ()
        present = self._places(pose, emissions)
        held = context.get_discrete_state(1).value()
        old = held[1:] if np.isfinite(held[0]) else present
        time = context.get_time()
        new = present if self._updates(time) else old
        return self._reverberation.frames(emissions, time, old, new, array)

    def _record(self, context: Any, output: Any) -> None:
        emissions = self._emissions(context)
        time, frame_s = context.get_time(), self._parameters.frame_s
        pose, velocity = read_arrays(context, self._motion)
        ego_noise = None
        if self._ego_noise is not None:
            share = driving_share(velocity, self._robot)
            ego_noise = self._ego_noise.frame(round(time / frame_s), share)
        array: Any = self._array.Eval(context)
        last = context.get_discrete_state(0).value()
        before = last[1:4], last[4:7]
        if abs(last[0] - (time - frame_s)) > _SAME_INSTANT_S:
            before = pose - frame_s * velocity, velocity
        output.set_value(
            record_frame(
                emissions,
                time,
                before,
                (pose, velocity),
                array,
                parameters=self._parameters,
                seed=self._seed,
                rise=self._rise,
                reflections=self._reflections(context, pose, emissions, array),
                ego_noise=ego_noise,
            )
        )
