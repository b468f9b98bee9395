"""One stop of a hearing robot: a sound at a known place, and what is heard of it."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from systems.base.robot import RobotParameters
from systems.framework.faults import Fault
from systems.framework.signals import AudioFrame, Emission
from systems.hearing.cross_power_estimator import ArrayListener, Direction
from systems.hearing.cross_powers import CrossPowers, gather_frame, no_powers
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.mic_array import microphone_reach
from systems.sound.parameters import (
    MicArrayParameters,
    RoomParameters,
    SoundParameters,
)
from systems.sound.recorder import Recorder
from systems.sound.sound_emitter import history_ticks, make_emission
from systems.sound.waveforms import make_waveform

#: Distance of the fan, m.
FAN_M = 2.0
_FRAME_S = 0.025
#: The fan's noise lasts from before the run to its end.
_ALWAYS_S = 60.0


@dataclass(frozen=True)
class BearingTrial:
    """A robot that stands, and a sound."""

    sound: SoundParameters
    distance: float
    """From the middle microphone, m."""
    bearing: float
    """From x of B, rad."""
    seed: int = 0
    """Of noise and noise-like sounds."""
    position_m: tuple[float, float] = (0.0, 0.0)
    """Of the robot, which heads along x, in W."""
    room: RoomParameters | None = None
    snr_db: float = 20.0
    """Level of the sound at the array over the microphones' noise, dB."""
    listen_s: float = 2.0
    noise_s: float = 0.5
    """Before the sound begins it listens to the noise alone for so long."""
    fan_bearing: float | None = None
    """Of a fan 2 m away with steady noise, rad; None: there is none."""
    fan_snr_db: float = 0.0
    """Level of the sound at the array over the fan's, dB."""
    faults: tuple[Fault, ...] = field(default=())


def hear_once(
    trial: BearingTrial,
    method: type[ArrayListener] = ArrayListener,
    *,
    subtract: bool = True,
) -> Direction | None:
    """What is heard of a sound in a stop.

    Args:
        trial: The stop.
        method: How directions are estimated.
        subtract: Whether the noise before the sound is known and subtracted.

    Returns:
        As ``ArrayListener.direction``.
    """
    robot = RobotParameters(preset="song2011_hearing")
    at_1m = trial.snr_db + 20.0 * math.log10(trial.distance)
    microphones = MicArrayParameters(sample_rate_hz=32_000.0, snr_db_at_1m=at_1m)
    listener = method(robot, SOUND_SPEED_M_S, microphones)
    nothing = no_powers(listener.facts)
    heard = {"noise": nothing, "sound": nothing}
    frames = _frames(trial, robot, microphones)
    quiet = round(trial.noise_s / _FRAME_S)
    for kind, part in (("noise", frames[:quiet]), ("sound", frames[quiet:])):
        gathered: CrossPowers = heard[kind]
        for before, now in itertools.pairwise(part):
            both = before.counts.astype(float), now.counts.astype(float)
            gathered = gather_frame(listener.facts, gathered, *both)
        heard[kind] = gathered
    return listener.direction(heard["sound"], heard["noise"] if subtract else nothing)


def _frames(
    trial: BearingTrial, robot: RobotParameters, microphones: MicArrayParameters
) -> list[AudioFrame]:
    """All frames of the stop; the sound begins, and has arrived, after the noise."""
    middle = np.add(robot.microphones_m[0], (robot.control_point_m, 0.0))
    middle = middle + trial.position_m
    begin = trial.noise_s - trial.distance / SOUND_SPEED_M_S
    sounds = [
        (
            trial.sound.model_copy(
                update={"start_s": trial.sound.start_s + max(begin, 0.0)}
            ),
            _place(middle, trial.bearing, trial.distance),
        )
    ]
    if trial.fan_bearing is not None:
        level = trial.sound.level_pa / trial.distance * FAN_M
        level *= 10.0 ** (-trial.fan_snr_db / 20.0)
        fan = SoundParameters(
            kind="band_noise",
            low_hz=200.0,
            high_hz=6_000.0,
            level_pa=level,
            on_s=_ALWAYS_S,
            period_s=_ALWAYS_S,
        )
        sounds.append((fan, _place(middle, trial.fan_bearing, FAN_M)))
    recorder = Recorder(
        microphones,
        robot,
        SOUND_SPEED_M_S,
        room=trial.room,
        sources=len(sounds),
        seed=trial.seed,
        faults=trial.faults,
    )
    count = round((trial.noise_s + trial.listen_s) / _FRAME_S)
    reach = microphone_reach(trial.room, SOUND_SPEED_M_S)
    ticks = history_ticks(reach, SOUND_SPEED_M_S, _FRAME_S)
    played = []
    for number, (sound, place) in enumerate(sounds):
        p_WS = np.tile(place, (ticks + 1, 1))
        waveform = make_waveform(sound, trial.seed + number)
        played.append((waveform, sound, p_WS, np.zeros_like(p_WS)))
    pose = np.array([*trial.position_m, 0.0])
    memory, frames = recorder.blank, []
    for tick in range(1, count + 1):
        now, time = (pose, np.zeros(3)), tick * _FRAME_S
        emissions: list[Emission] = [make_emission(time, *each) for each in played]
        frames.append(recorder.record(emissions, time, now, memory, recorder.array))
        memory = recorder.remembered(emissions, time, now, memory)
    return frames


def _place(
    middle: NDArray[np.float64], bearing: float, distance: float
) -> NDArray[np.float64]:
    return middle + distance * np.array([math.cos(bearing), math.sin(bearing)])
