"""The robot's microphones, with their converter."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, LeafSystem

from systems.base.robot import RobotParameters
from systems.framework.block_facts import BlockFacts
from systems.framework.cache import declare_cache
from systems.framework.finite import check_finite, check_record, read_arrays
from systems.framework.host_step import host_step
from systems.framework.noise import BEFORE_THE_RUN, frame_noise, tick_generator
from systems.framework.signals import (
    SAMPLE_RATE_HZ,
    AudioFrame,
    Emission,
    read_only,
)
from systems.framework.step_block import RunFacts, Step
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


class MicMemory(NamedTuple):
    """What a frame leaves behind for the next one."""

    last: NDArray[np.float64]
    """(7,) time, pose and velocity of the robot at its end."""
    places: NDArray[np.float64] | None = None
    """Time, pose of the robot and place of each source at the last update of the
    room; none in the free field."""


class Recorder:
    """Records frame by frame: what a ``MicArray`` does, without a context.

    Args:
        parameters: Microphones, amplifier and converter.
        robot: Places of the microphones.
        c: Speed of sound, m/s.
        room: Walls, if there are any.
        sources: How many sound.
        seed: Seed of the noise and of the array's errors.

    Raises:
        ValueError: As ``MicArray``.
    """

    def __init__(
        self,
        parameters: MicArrayParameters,
        robot: RobotParameters,
        c: float,
        *,
        room: RoomParameters | None,
        sources: int,
        seed: int,
    ) -> None:
        self._parameters, self._robot, self._c = parameters, robot, c
        self._reverberation, self._ego_noise, places = None, None, None
        self._rise = room.rise_m if room else 0.0
        if room:
            self._reverberation = Reverberation(room, c, parameters)
            self._update_frames = room.update_frames(parameters.frame_s)
            places = np.r_[-np.inf, np.zeros(3 + 2 * sources)]
        if parameters.ego_noise_file is not None:
            self._ego_noise = EgoNoise(parameters, len(robot.microphones_m), seed)
        self.blank = MicMemory(np.r_[-np.inf, np.zeros(6)], places)
        """The memory before the first frame."""
        self._draw(seed)

    def _draw(self, seed: int) -> None:
        self._seed = seed
        count = len(self._robot.microphones_m)
        generator = tick_generator(seed, BEFORE_THE_RUN)
        self.tolerances = draw_tolerances(self._parameters, count, generator)
        """Errors of the array."""
        self.array = real_array(
            microphones_B(self._robot), self._parameters, self.tolerances, self._c
        )
        """The array with these errors."""

    def of_seed(self, seed: int) -> Recorder:
        """The same with other noise and other errors of the array."""
        other = copy(self)
        if self._ego_noise is not None:
            other._ego_noise = self._ego_noise.of_seed(seed)
        other._draw(seed)
        return other

    def remembered(
        self,
        emissions: Sequence[Emission],
        time: float,
        now: tuple[NDArray[np.float64], NDArray[np.float64]],
        memory: MicMemory,
    ) -> MicMemory:
        """What a frame leaves for the next one.

        Args:
            emissions: Of the sources, the followed one first.
            time: Now, s.
            now: Pose and velocity of the robot, (3,) each.
            memory: What the last frame left.

        Returns:
            The new memory.
        """
        last = np.empty(7)
        last[0], last[1:4], last[4:] = time, *now
        places = memory.places
        if self._reverberation and self.updates(time):
            places = np.r_[time, self._places(now[0], emissions)]
        return MicMemory(last, places)

    def updates(self, time: float) -> bool:
        """Whether reflections take new places at a frame's end."""
        return round(time / self._parameters.frame_s) % self._update_frames == 0

    def _places(
        self, pose: NDArray[np.float64], emissions: Sequence[Emission]
    ) -> NDArray[np.float64]:
        """Pose of the robot and places of the sources, one after the other."""
        now = [emission.p_WS[-1] for emission in emissions]
        return np.concatenate([pose, *now])

    def _reflections(
        self,
        emissions: Sequence[Emission],
        time: float,
        pose: NDArray[np.float64],
        held: NDArray[np.float64] | None,
        array: RealArray,
    ) -> Sequence[NDArray[np.float32] | None]:
        if self._reverberation is None or held is None:
            return ()
        present = self._places(pose, emissions)
        old = held[1:] if np.isfinite(held[0]) else present
        new = present if self.updates(time) else old
        return self._reverberation.frames(emissions, time, old, new, array)

    def record(
        self,
        emissions: Sequence[Emission],
        time: float,
        now: tuple[NDArray[np.float64], NDArray[np.float64]],
        memory: MicMemory,
        array: RealArray,
    ) -> AudioFrame:
        """The frame that ends now, whatever context the block is in.

        Args:
            emissions: Of the sources, the followed one first.
            time: Now, s.
            now: Pose and velocity of the robot, (3,) each.
            memory: What the last frame left.
            array: The microphones with their errors.

        Returns:
            Counts of all channels, see ``record_frame``.

        Raises:
            InputError: A source is out of the emission's reach, or out of the room.
        """
        frame_s, ego_noise = self._parameters.frame_s, None
        pose, velocity = now
        if self._ego_noise is not None:
            share = driving_share(velocity, self._robot)
            ego_noise = self._ego_noise.frame(round(time / frame_s), share)
        last = memory.last
        before = last[1:4], last[4:7]
        if abs(last[0] - (time - frame_s)) > _SAME_INSTANT_S:
            before = pose - frame_s * velocity, velocity
        return record_frame(
            emissions,
            time,
            before,
            now,
            array,
            parameters=self._parameters,
            seed=self._seed,
            rise=self._rise,
            reflections=self._reflections(emissions, time, pose, memory.places, array),
            ego_noise=ego_noise,
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
        self.set_name("mic_array")
        c = (acoustics or AcousticParameters()).c
        # Refuses a bad skew before anything runs.
        self._recorder = Recorder(
            self._parameters,
            self._robot,
            c,
            room=room,
            sources=1 + len(others),
            seed=seed,
        )
        self._declare_errors(c)
        self._sources = [
            self.DeclareAbstractInputPort(name=name, model_value=Value(object()))
            for name in ("emission", *(f"emission_{name}" for name in others))
        ]
        self._motion = [
            self.DeclareVectorInputPort(name=name, size=3)
            for name in ("pose_WB", "velocity_WB")
        ]
        group: Any
        for group in self._recorder.blank:
            if group is not None:
                self.DeclareDiscreteState(group)
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
        drawn = self._recorder.tolerances
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

    def _memory(self, context: Any) -> MicMemory:
        groups = range(context.num_discrete_state_groups())
        return MicMemory(*(context.get_discrete_state(k).value() for k in groups))

    def _remember(self, context: Any, discrete_state: Any) -> None:
        now: Any = read_arrays(context, self._motion)
        old, time = self._memory(context), context.get_time()
        emissions: Sequence[Emission] = ()
        if old.places is not None and self._recorder.updates(time):
            emissions = self._emissions(context)
        new = self._recorder.remembered(emissions, time, now, old)
        for group, values in enumerate(new):
            if values is not None and values is not old[group]:
                discrete_state.set_value(group, values)

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

    def _record(self, context: Any, output: Any) -> None:
        emissions, time = self._emissions(context), context.get_time()
        now: Any = read_arrays(context, self._motion)
        memory = self._memory(context)
        array: Any = self._array.Eval(context)
        frame = self._recorder.record(emissions, time, now, memory, array)
        output.set_value(frame)

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each frame of a compiled loop, ``Step``."""
        recorder = self._recorder.of_seed(run.seed_of(self.get_name()))
        emitted = [run.carried[port.get_name()] for port in self._sources]
        memory = recorder.blank
        frame: AudioFrame | None = None

        def record(tick: int, inputs: Any, _: Any) -> None:
            nonlocal memory, frame
            time, now = tick * run.tick_s, (inputs[:3], inputs[3:])
            emissions = [emission(tick) for emission in emitted]
            frame = recorder.record(emissions, time, now, memory, recorder.array)
            memory = recorder.remembered(emissions, time, now, memory)

        run.carried["audio"] = lambda _: frame
        return host_step(record, 6, 0, round(self._parameters.frame_s / run.tick_s))
