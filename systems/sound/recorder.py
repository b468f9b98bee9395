"""Records the sound at a microphone array, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters, microphones_B
from systems.framework.faults import Fault, faults_of
from systems.framework.noise import frame_noise
from systems.framework.signals import AudioFrame, Emission, read_only
from systems.sound.adc import convert
from systems.sound.ego_noise import EgoNoise
from systems.sound.parameters import (
    UPDATE_PERIOD_S,
    MicArrayParameters,
    RoomParameters,
)
from systems.sound.propagation import check_reach, microphone_paths, propagate
from systems.sound.real_array import RealArray, no_errors, real_array
from systems.sound.reverberation import Reverberation

# Two times closer than this count as the same time, s.
_SAME_INSTANT_S = 1e-6


def record_frame(
    emissions: Sequence[Emission],
    time: float,
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
    now: tuple[NDArray[np.float64], NDArray[np.float64]],
    array: RealArray,
    *,
    parameters: MicArrayParameters,
    seed: int,
    reflections: Sequence[NDArray[np.float32] | None] = (),
    ego_noise: NDArray[np.float32] | None = None,
    faults: Mapping[int, Fault] | None = None,
) -> AudioFrame:
    """Records the frame of audio that ends at the present time.

    Args:
        emissions: Sounds of the sources. The noise level is relative to the first
            sound.
        time: Present time, s.
        before: Pose (3,), m and rad, and velocity (3,), m/s and rad/s, of the robot in
            the world frame W at the beginning of the audio frame.
        now: Present pose and velocity of the robot, in the form of ``before``.
        array: True array, from ``real_array``.
        parameters: Microphones, amplifier, converter and length of the frame.
        seed: Seed of the noise.
        reflections: One entry per source: (n, samples) sound pressure of its
            reflections, Pa, or None if the source is silent.
        ego_noise: (n, samples) ego noise divided by the level of the first source at 1
            m.
        faults: Fault of each microphone that fails, by its index.

    Returns:
        (n, samples) counts, with their full scale, rate and time.

    Raises:
        ValueError: A source is too far away for its stored emission.
    """
    direct = _direct_sound(emissions, time, before, now, array, parameters)
    pressure = _total([*direct, *reflections])
    number = round(time / parameters.frame_s)
    noise = frame_noise((len(array.p_BM), parameters.frame_samples), seed, number)
    snr = 10.0 ** (parameters.snr_db_at_1m / 20.0)
    if ego_noise is not None:
        noise += np.float32(snr) * ego_noise
    noise_pa = emissions[0].level_pa / snr
    counts = convert(pressure, noise, noise_pa, parameters, array.gains)
    for k, fault in (faults or {}).items():
        if time > fault.start_s:
            counts[k] = parameters.full_scale // 4 if fault.kind == "frozen" else 0
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
) -> list[NDArray[np.float32]]:
    """Computes the (n, samples) direct sound pressure of each sounding source, Pa."""
    begin = time - parameters.frame_s
    sounding = [emission for emission in emissions if emission.sounding]
    for emission in emissions:
        if not emission.sounding:  # for silence, the position of the robot suffices
            check_reach(emission, begin, before[0][:2], array.c)
    if not sounding:
        return []
    times = begin + array.instants
    p_WM, v_WM = microphone_paths(times, begin, *before, time, *now, array.p_BM)
    arriving = (times, p_WM, v_WM, parameters.frame_samples, array.c)
    return [propagate(emission, *arriving) for emission in sounding]


def _total(
    pressures: Sequence[NDArray[np.float32] | None],
) -> NDArray[np.float32] | None:
    """Adds the pressures in place of the first one. Returns None if all are silent."""
    heard = [pressure for pressure in pressures if pressure is not None]
    for pressure in heard[1:]:
        heard[0] += pressure
    return heard[0] if heard else None


class MicMemory(NamedTuple):
    """State of a recorder between two frames."""

    last: NDArray[np.float64]
    """(7,) time, pose and velocity of the robot at the end of the last frame."""
    places: NDArray[np.float64] | None = None
    """Values at the last update of the reflections: time, pose of the robot, and
    position of each source. None in the free field."""


class Recorder:
    """Records audio frames like ``MicArray``, but without a Drake context.

    Args:
        parameters: Microphones, amplifier and converter.
        robot: Positions of the microphones.
        c: Speed of sound, m/s.
        room: Walls; None for the free field.
        sources: Number of sources.
        seed: Seed of the noise.
        faults: Faults of the robot. Only the faults of ``microphones`` have an effect.

    Raises:
        ValueError: See ``MicArray``.
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
        faults: Sequence[Fault] = (),
    ) -> None:
        count = len(robot.microphones_m)
        self._faults = faults_of(faults, "microphones", count)
        self._parameters = parameters
        self._reverberation, self._ego_noise, places = None, None, None
        if room:
            self._reverberation = Reverberation(room, c, parameters)
            self._update_frames = max(1, round(UPDATE_PERIOD_S / parameters.frame_s))
            places = np.r_[-np.inf, np.zeros(3 + 2 * sources)]
        if parameters.ego_noise_file is not None:
            self._ego_noise = EgoNoise(parameters, count, seed)
        self.blank = MicMemory(np.r_[-np.inf, np.zeros(6)], places)
        """State before the first frame."""
        self._seed = seed
        self.array = real_array(microphones_B(robot), parameters, no_errors(count), c)
        """Array without errors."""

    def of_seed(self, seed: int) -> Recorder:
        """Returns the same recorder with other noise."""
        other = copy(self)
        if self._ego_noise is not None:
            other._ego_noise = self._ego_noise.of_seed(seed)
        other._seed = seed
        return other

    def remembered(
        self,
        emissions: Sequence[Emission],
        time: float,
        now: tuple[NDArray[np.float64], NDArray[np.float64]],
        memory: MicMemory,
    ) -> MicMemory:
        """Returns the state of the recorder after an audio frame.

        Args:
            emissions: Sounds of the sources, the followed source first.
            time: Present time, s.
            now: Present pose (3,) and velocity (3,) of the robot.
            memory: State after the previous frame.

        Returns:
            The new state.
        """
        last = np.empty(7)
        last[0], last[1:4], last[4:] = time, *now
        places = memory.places
        if self._reverberation and self.updates(time):
            places = np.r_[time, self._places(now[0], emissions)]
        return MicMemory(last, places)

    def updates(self, time: float) -> bool:
        """Returns whether the reflections get new positions at a time, s."""
        return round(time / self._parameters.frame_s) % self._update_frames == 0

    def _places(
        self, pose: NDArray[np.float64], emissions: Sequence[Emission]
    ) -> NDArray[np.float64]:
        """Returns the pose of the robot and then the positions of the sources."""
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
        """Records the frame of audio that ends at the present time.

        Args:
            emissions: Sounds of the sources, the followed source first.
            time: Present time, s.
            now: Present pose (3,) and velocity (3,) of the robot.
            memory: State after the previous frame.
            array: Microphones with their errors.

        Returns:
            Counts of all channels, see ``record_frame``.

        Raises:
            InputError: A source is too far away for its stored emission, or is outside
                the room.
        """
        frame_s, ego_noise = self._parameters.frame_s, None
        pose, velocity = now
        if self._ego_noise is not None:
            ego_noise = self._ego_noise.frame(round(time / frame_s))
        # Without a state from one frame ago, extrapolate the present velocity backward.
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
            reflections=self._reflections(emissions, time, pose, memory.places, array),
            ego_noise=ego_noise,
            faults=self._faults,
        )
