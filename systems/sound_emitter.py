"""The loudspeaker on the master robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import LeafSystem

from systems.acoustics import AcousticParameters
from systems.signals import FRAME_PERIOD_S, SAMPLE_RATE_HZ, Emission
from systems.waveforms import SoundParameters, make_waveform

__all__ = ["SoundEmitter", "emitted_samples"]

#: Samples before and after what the delays need, for the interpolation.
MARGIN = 64


def emitted_samples(
    waveform: NDArray[np.float32],
    sound: SoundParameters,
    first: int,
    count: int,
) -> NDArray[np.float32] | None:
    """Samples ``first`` to ``first + count`` of what the loudspeaker plays.

    Args:
        waveform: Bursts end to end, from ``make_waveform``.
        sound: The gate.
        first: Number of the first sample; sample n is emitted at n / 100 kHz.
        count: Number of samples.

    Returns:
        (count,) Pa at 1 m, or None where all are zero.
    """
    burst = round(sound.on_s * SAMPLE_RATE_HZ)
    period = round(sound.period_s * SAMPLE_RATE_HZ)
    start = round(sound.start_s * SAMPLE_RATE_HZ)
    bursts = len(waveform) // burst
    out = None
    number = max(0, (first - start - burst) // period)
    while (begin := start + number * period) < first + count:
        low, high = max(begin, first), min(begin + burst, first + count)
        if low < high:
            if out is None:
                out = np.zeros(count, dtype=np.float32)
            offset = (number % bursts) * burst - begin
            out[low - first : high - first] = waveform[low + offset : high + offset]
        number += 1
    return out


class SoundEmitter(LeafSystem):
    """Plays the sound from where the source is.

    .. pydrake_system::

        name: SoundEmitter
        input_ports:
        - pose_WS [m, m, rad]
        - v_WS [m/s, m/s, rad/s]
        output_ports:
        - emission [Emission]

    Discrete state, 25 ms: position and velocity of the source at the last
    ticks, as far back as sound from the maximum range was emitted; before
    time zero the source rests where it starts. The output is a function of
    time, state and present input: no latency. Before time zero it is silent.

    Args:
        sound: What to play.
        acoustics: Speed of sound.
        maximum_range_m: Farthest listener, m.
        seed: Seed of noise-like waveforms.

    Raises:
        ValueError: The sound file cannot be played.

    Reference: Han 2019, section 4.1.
    """

    def __init__(
        self,
        *,
        sound: SoundParameters | None = None,
        acoustics: AcousticParameters | None = None,
        maximum_range_m: float = 30.0,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self._sound = sound or SoundParameters()
        self._waveform = make_waveform(self._sound, seed)
        travel = maximum_range_m / (acoustics or AcousticParameters()).c
        self._ticks = math.ceil((FRAME_PERIOD_S + travel) / FRAME_PERIOD_S) + 1
        self._knot_ages = FRAME_PERIOD_S * np.arange(self._ticks, -1.0, -1.0)
        self._silence = np.zeros(self._count, dtype=np.float32)
        self.set_name("sound_emitter")
        self._pose_WS = self.DeclareVectorInputPort(name="pose_WS", size=3)
        self._v_WS = self.DeclareVectorInputPort(name="v_WS", size=3)
        self.DeclareDiscreteState(4 * self._ticks)
        self.DeclareInitializationDiscreteUpdateEvent(update=self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(
            period_sec=FRAME_PERIOD_S, offset_sec=0.0, update=self._remember
        )
        self.DeclareAbstractOutputPort(
            name="emission",
            alloc=lambda: Value(object()),
            calc=self._emit,
            prerequisites_of_calc={
                self._pose_WS.ticket(),
                self._v_WS.ticket(),
                self.xd_ticket(),
                self.time_ticket(),
            },
        )

    @property
    def _count(self) -> int:
        """Samples of an emission."""
        return round(self._ticks * FRAME_PERIOD_S * SAMPLE_RATE_HZ) + MARGIN

    def _history(self, context) -> NDArray[np.float64]:
        """(ticks, 4) past x, y, vx, vy, oldest first."""
        return context.get_discrete_state(0).CopyToVector().reshape(-1, 4)

    def _present(self, context) -> NDArray[np.float64]:
        pose, velocity = self._pose_WS.Eval(context), self._v_WS.Eval(context)
        return np.array([pose[0], pose[1], velocity[0], velocity[1]])

    def _start(self, context, discrete_state) -> None:
        at_rest = [*self._pose_WS.Eval(context)[:2], 0.0, 0.0]
        discrete_state.set_value(np.tile(at_rest, self._ticks))

    def _remember(self, context, discrete_state) -> None:
        history = self._history(context)
        history[:-1] = history[1:]
        history[-1] = self._present(context)
        discrete_state.set_value(history.reshape(-1))

    def _emit(self, context, output) -> None:
        time = context.get_time()
        end = round(time * SAMPLE_RATE_HZ)
        first = end + MARGIN - self._count
        samples = emitted_samples(self._waveform, self._sound, first, self._count)
        path = np.empty((self._ticks + 1, 4))
        path[:-1] = self._history(context)
        path[-1] = self._present(context)
        output.set_value(
            Emission(
                samples=self._silence if samples is None else samples,
                start_time=first / SAMPLE_RATE_HZ,
                sample_rate_hz=float(SAMPLE_RATE_HZ),
                knot_times=time - self._knot_ages,
                p_WS=path[:, :2].copy(),
                v_WS=path[:, 2:].copy(),
                level_pa=self._sound.level_pa,
                sounding=samples is not None,
            )
        )
