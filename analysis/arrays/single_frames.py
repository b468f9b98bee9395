"""Makes single frames of sound in the free field, and estimators of single frames.

Source and microphones are at rest. A frame is 25 ms of audio. The frames come from the
function of the block for sound propagation, without a diagram.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.arrays.cramer_rao import SlopeEnergy
from systems.framework.signals import FRAME_SAMPLES, SAMPLE_RATE_HZ, TICK_S, Emission
from systems.hearing.localize import Localizer
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_fix import SourceFix
from systems.sound.array_shape import ArrayShape
from systems.sound.parameters import EDGE_S, SoundParameters
from systems.sound.propagation import propagate
from systems.sound.waveforms import make_waveform

Estimator = Callable[[NDArray[np.float32]], SourceFix | None]


def frame_estimator(
    parameters: TDOAParameters, shape: ArrayShape, c: float, *, limited: bool = True
) -> Estimator:
    """Makes a function that locates the source in a single (n, samples) frame.

    The function does what ``TDOAEstimator`` does in the first frame that it receives.
    If the frame has no detectable sound, the function returns None. If ``limited`` is
    false, the function also returns unreliable estimates.
    """
    localizer = Localizer(parameters, shape, c, limited=limited)
    return lambda frame: localizer.localize(frame, localizer.blank())[0]


@dataclass(frozen=True)
class Loudspeaker:
    """A continuous sound for all trials, with the energy of its slope."""

    samples: NDArray[np.float32]
    """(n,) sound pressure at 1 m, Pa."""
    energy: SlopeEnergy
    level_pa: float
    """RMS of the samples, Pa at 1 m."""

    @classmethod
    def of(cls, kind: str, seed: int, seconds: float = 2.0) -> Loudspeaker:
        """Makes a ``chirp`` or ``band_noise`` of 0.5-8 kHz at 100 kHz."""
        sound = SoundParameters.model_validate(
            {"kind": kind, "on_s": seconds, "period_s": seconds}
        )
        samples = make_waveform(sound, seed)
        edge = round(EDGE_S * SAMPLE_RATE_HZ)
        level = float(np.sqrt(np.mean(samples[edge:-edge] ** 2, dtype=float)))
        return cls(samples, SlopeEnergy.of(samples, SAMPLE_RATE_HZ), level)

    @property
    def seconds(self) -> float:
        """Length of the sound, s."""
        return len(self.samples) / SAMPLE_RATE_HZ

    def pressure(
        self,
        begin: ArrayLike,
        p_AS: NDArray[np.float64],
        p_AM: NDArray[np.float64],
        c: float,
    ) -> NDArray[np.float32]:
        """Computes the (n, samples) sound pressure of one frame at microphones, Pa.

        Source and microphones are at rest, at (2,) p_AS and (n, 2) p_AM, m. ``begin``
        is the time of the frame's first sample in s, either (n,), or one time for all
        channels.
        """
        emission = Emission(
            samples=self.samples,
            start_time=0.0,
            sample_rate_hz=float(SAMPLE_RATE_HZ),
            knot_times=np.array([0.0, self.seconds]),
            p_WS=np.tile(p_AS, (2, 1)),
            v_WS=np.zeros((2, 2)),
            level_pa=self.level_pa,
            sounding=True,
        )
        begins = np.broadcast_to(begin, len(p_AM))
        times = np.stack((begins, begins + TICK_S), axis=1)
        p_WM = np.repeat(p_AM[:, None, :], 2, axis=1)
        return propagate(emission, times, p_WM, np.zeros(p_WM.shape), FRAME_SAMPLES, c)
