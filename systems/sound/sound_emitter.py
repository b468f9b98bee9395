"""Simulates the loudspeaker on the leader."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.block import OBJECT, Block, Port, RunFacts, Step
from systems.framework.finite import check_finite, read_arrays
from systems.framework.host_step import host_step
from systems.framework.signals import SAMPLE_RATE_HZ, TICK_S, Emission, read_only
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.parameters import SoundParameters
from systems.sound.waveforms import make_waveform

#: Largest distance that sound travels if there is no room, m.
MAXIMUM_RANGE_M = 30.0

#: Start time of the sound of a loudspeaker that has not been called yet, s.
_NEVER_S = 86_400.0

#: Number of additional samples at the end of an emission, for the interpolation.
MARGIN = 64


def emitted_samples(
    waveform: NDArray[np.float32],
    sound: SoundParameters,
    first: int,
    count: int,
) -> NDArray[np.float32] | None:
    """Returns the samples that the loudspeaker plays in an interval.

    Args:
        waveform: Bursts of sound, end to end, from ``make_waveform``.
        sound: Schedule of the bursts.
        first: Number of the first sample. Sample n is emitted at the time n / 100 kHz.
        count: Number of samples.

    Returns:
        (count,) sound pressure at 1 m, Pa; None if all samples are zero. If a single
        burst covers all samples, the array is a view of the waveform.
    """
    burst, period, start = _gate(sound.on_s, sound.period_s, sound.start_s)
    bursts = len(waveform) // burst
    out = None
    # Visit all bursts that overlap the samples.
    number = max(0, (first - start - burst) // period)
    while (begin := start + number * period) < first + count:
        low, high = max(begin, first), min(begin + burst, first + count)
        offset = (number % bursts) * burst - begin
        if high - low == count:
            return waveform[low + offset : high + offset]
        if low < high:
            if out is None:
                out = np.zeros(count, dtype=np.float32)
            out[low - first : high - first] = waveform[low + offset : high + offset]
        number += 1
    return out


@cache
def _gate(on_s: float, period_s: float, start_s: float) -> tuple[int, int, int]:
    """Returns the samples in a burst, in a period, and before the first burst."""
    burst, period, start = (
        round(time * SAMPLE_RATE_HZ) for time in (on_s, period_s, start_s)
    )
    return burst, period, start


def make_emission(
    time: float,
    waveform: NDArray[np.float32],
    sound: SoundParameters,
    p_WS: NDArray[np.float64],
    v_WS: NDArray[np.float64],
    tick_s: float = TICK_S,
) -> Emission:
    """Makes the record of the sound that has left the loudspeaker up to the present.

    Args:
        time: Present time, a multiple of 10 us, s.
        waveform: Bursts of sound, end to end, from ``make_waveform``.
        sound: Schedule of the bursts.
        p_WS: (k, 2) positions of the source in the world frame W at the last k control
            periods (ticks), m. The last row is the present tick.
        v_WS: (k, 2) velocities of the source in W at these ticks, m/s.
        tick_s: Time from one tick to the next, s.

    Returns:
        The sound and the motion of the source, in read-only arrays.
    """
    ages, count = _history(len(p_WS), tick_s)
    first = round(time * SAMPLE_RATE_HZ) + MARGIN - count
    samples = emitted_samples(waveform, sound, first, count)
    emitted = _silence(count) if samples is None else samples
    knot_times = time - ages
    read_only(emitted, knot_times, p_WS, v_WS)
    # Keyword arguments would take a microsecond longer.
    return Emission(
        emitted,
        first / SAMPLE_RATE_HZ,
        float(SAMPLE_RATE_HZ),
        knot_times,
        p_WS,
        v_WS,
        sound.level_pa,
        samples is not None,
    )


@cache
def _history(ticks: int, tick_s: float) -> tuple[NDArray[np.float64], int]:
    """Returns the ages of the last ticks, s, and the samples of an emission."""
    ages = tick_s * np.arange(ticks - 1.0, -1.0, -1.0)
    return ages, round(ages[0] * SAMPLE_RATE_HZ) + MARGIN


@cache
def _silence(count: int) -> NDArray[np.float32]:
    return np.zeros(count, dtype=np.float32)


@cache
def called_sound(sound: SoundParameters, on_since_s: float | None) -> SoundParameters:
    """Returns the sound of a loudspeaker that is silent until the robot calls it.

    Args:
        sound: Sound of the loudspeaker. Its first burst is ``start_s`` after the call.
        on_since_s: Time of the call, s; None before the call.

    Returns:
        The sound, with the time of its first burst in ``start_s``. Before the call,
        this time is one day, so that the loudspeaker stays silent.
    """
    since = _NEVER_S if on_since_s is None else on_since_s + sound.start_s
    return sound.model_copy(update={"start_s": since})


def history_ticks(
    maximum_range_m: float, c: float, frame_s: float = TICK_S, tick_s: float = TICK_S
) -> int:
    """Returns the number of control periods (ticks) in the stored motion of the source.

    Sound needs time to travel. The stored motion must therefore begin before the
    emission of the earliest sound in the present audio frame.

    Args:
        maximum_range_m: Largest distance that sound travels, m.
        c: Speed of sound, m/s.
        frame_s: Longest audio frame of a listener, s.
        tick_s: Time from one tick to the next, s.

    Returns:
        Number of ticks, including the present tick.
    """
    return math.ceil((frame_s + maximum_range_m / c) / tick_s) + 1


class SoundEmitter(Block):
    """Plays the sound at the position of the source.

    The discrete state has the positions and velocities of the source at the last
    control periods (ticks). The state reaches back far enough for sound from the
    maximum range. The block updates the state every tick. Before time zero, the source
    is silent and at rest at its initial position. The output is a function of time,
    state and present input, without latency.

    If ``called`` is set, the block has a further input port ``calling`` (0 or 1). The
    block stores the tick at which this port is 1 for the first time. The schedule of
    the sound starts at this tick.

    Args:
        sound: Waveform, level and schedule of the sound.
        sound_speed_m_s: Speed of sound, m/s.
        maximum_range_m: Largest distance that sound travels to a listener, including
            reflections, m.
        frame_s: Longest audio frame of a listener, s.
        seed: Seed of the waveforms with noise.
        tick_s: Period of the update, s.
        called: Whether the loudspeaker is silent until its input ``calling`` is 1.

    Raises:
        ValueError: The sound file cannot be played, or the range is not finite.

    Reference: Han 2019, section 4.1.
    """

    part, stage = "emitter", "hearing"
    inputs: Sequence[Port] = (
        Port("pose_WS", 3, "m, m, rad"),
        Port("v_WS", 3, "m/s, m/s, rad/s"),
    )
    outputs = (Port("emission", OBJECT, "Emission"),)

    def __init__(
        self,
        *,
        sound: SoundParameters = SoundParameters(),
        sound_speed_m_s: float = SOUND_SPEED_M_S,
        maximum_range_m: float = MAXIMUM_RANGE_M,
        frame_s: float = TICK_S,
        seed: int = 0,
        tick_s: float = TICK_S,
        called: bool = False,
    ) -> None:
        super().__init__()
        self._sound = sound
        self._waveform = make_waveform(sound, seed)
        check_finite("SoundEmitter: maximum_range_m", maximum_range_m)
        self._tick_s = tick_s
        self._ticks = history_ticks(maximum_range_m, sound_speed_m_s, frame_s, tick_s)
        self.set_name("sound_emitter")
        if called:
            self.inputs = (*self.inputs, Port("calling", 1, "0 or 1"))
        ports = self.declare_ports()
        self._motion, self._calling = ports[:2], ports[2:]
        self.DeclareDiscreteState(4 * self._ticks)
        if called:
            never: Any = np.array([-1.0])  # Any: Drake's stubs misread ndarray here
            self.DeclareDiscreteState(never)
        self.DeclareInitializationDiscreteUpdateEvent(update=self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=tick_s, offset_sec=0.0, update=self._remember
        )
        sources = {port.ticket() for port in self._motion}
        sources |= {self.xd_ticket(), self.time_ticket()}
        self._emission = self.declare_output("emission", self._emit, sources)

    def _start(self, context: Any, discrete_state: Any) -> None:
        path = np.zeros((2, self._ticks, 2))
        path[0] = read_arrays(context, self._motion)[0][:2]
        discrete_state.set_value(0, path.ravel())

    def _remember(self, context: Any, discrete_state: Any) -> None:
        emission = self._emission.Eval(context)
        path = np.concatenate((emission.p_WS[1:], emission.v_WS[1:]))
        discrete_state.set_value(0, path.ravel())
        if not self._calling or self._on_since(context) is not None:
            return
        if self._calling[0].Eval(context)[0] > 0.5:
            discrete_state.set_value(1, np.array([context.get_time()]))

    def _on_since(self, context: Any) -> float | None:
        """Returns the time of the call, s; None before the call."""
        since = float(context.get_discrete_state(1).value()[0])
        return None if since < 0.0 else since

    def _emit(self, context: Any, output: Any) -> None:
        held, split = context.get_discrete_state(0).value(), 2 * self._ticks
        pose_WS, velocity = read_arrays(context, self._motion)
        p_WS = np.concatenate((held[:split], pose_WS[:2])).reshape(-1, 2)
        v_WS = np.concatenate((held[split:], velocity[:2])).reshape(-1, 2)
        time, sound = context.get_time(), self._sound
        if self._calling:
            sound = called_sound(sound, self._on_since(context))
        output.set_value(
            make_emission(time, self._waveform, sound, p_WS, v_WS, self._tick_s)
        )

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step of the block for a compiled simulation loop.

        The step stores the motion of the source. It also provides a function that
        returns the emission at a given tick (control period). This function makes an
        emission only when another block reads it.

        Args:
            run: Seed and period of the run.

        Returns:
            The step.

        Raises:
            InputError: The sound file cannot be played.
        """
        waveform = make_waveform(self._sound, run.seed_of(self.get_name()))
        p_WS, v_WS = np.zeros((2, self._ticks + run.ticks + 1, 2))
        since: float | None = None

        def remember(tick: int, inputs: Any, _: Any) -> None:
            nonlocal since
            if tick == 0:
                p_WS[:] = inputs[:2]
            p_WS[self._ticks + tick], v_WS[self._ticks + tick] = inputs[:2], inputs[3:5]
            if self._calling and since is None and inputs[6] > 0.5:
                since = tick * run.tick_s

        def emission(tick: int) -> Emission:
            known = slice(tick, tick + self._ticks + 1)
            sound = called_sound(self._sound, since) if self._calling else self._sound
            path = p_WS[known], v_WS[known]
            return make_emission(tick * run.tick_s, waveform, sound, *path, run.tick_s)

        step = host_step(remember, 6 + len(self._calling), 0, 1)
        return step._replace(carries={"emission": emission})
