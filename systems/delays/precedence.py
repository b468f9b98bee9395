"""Keeps the first wave front of every sound and suppresses its echoes.

In a room the direct sound comes first; what follows in the same band is, for
some tens of milliseconds, more likely an echo of it than news. Short-time
spectra of each channel are therefore weighted by how far they rise above a
decaying memory of their past, and whitened: the precedence effect, as in the
echo-free onsets of Huang, Ohnishi and Sugie (1995). All weights are real, so
that delays between the channels stay what they are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.framework.compiling import njit

# Short against the first echoes, long against a period of the lowest band, s.
_WINDOW_S = 2.56e-3
_HOPS_PER_WINDOW = 4

# Memory of a room that decays by 60 dB in 0.69 s; the trials in
# docs/results_hearing.md change little from 20 to 100 ms.
_DECAY_S = 0.05

# Only what rises this many times above the noise is news: one bin of noise in
# exp(4) does. Others would be whitened to the size of the sound.
_NOISE_MARGIN = 4.0

# Whitening stops at this share of a channel's strongest instant.
_WHITENING_FLOOR = 0.01


class EchoMemory:
    """Sizes of the memory for frames of a rate."""

    def __init__(self, channels: int, sample_rate_hz: float) -> None:
        self.window = _HOPS_PER_WINDOW * max(
            4, round(_WINDOW_S * sample_rate_hz / _HOPS_PER_WINDOW)
        )
        self.hop = self.window // _HOPS_PER_WINDOW
        self.shape = (channels, self.window // 2 + 1)
        self.decay_a_hop = math.exp(-self.hop / sample_rate_hz / _DECAY_S)
        phase = (np.arange(self.window) + 0.5) / self.window
        # Its square adds up to a constant over four hops.
        self.taper = (np.sin(np.pi * phase) * math.sqrt(0.5)).astype(np.float32)

    def faded(self, memory: NDArray[np.float32], samples: int) -> NDArray[np.float32]:
        """The memory after so many samples of silence.

        Args:
            memory: (n, bins) power that echoes may still have, units of the frame
                squared.
            samples: Length of the silence.

        Returns:
            (n, bins), smaller by the decay of so many samples.
        """
        return memory * np.float32(self.decay_a_hop ** (samples / self.hop))

    def least(self, noise_density: float) -> float:
        """What is remembered at least of noise of so much energy a sample."""
        return _NOISE_MARGIN * noise_density * float(np.vdot(self.taper, self.taper))


@njit(cache=True)
def _weigh(
    spectra: NDArray[np.complex64],
    memory: NDArray[np.float32],
    decay: np.float32,
    floor: np.float32,
    noise: np.float32,
) -> float:  # pragma: no cover  (compiled)
    """Weights spectra (n, instants, bins) in place; memory becomes the last one.

    Returns:
        Share of the energy that is news.
    """
    channels, instants, bins = spectra.shape
    kept, all_of_it = 0.0, 1e-30
    for m in range(channels):
        strongest = np.float32(0.0)
        for t in range(instants):
            total = np.float32(0.0)
            for k in range(bins):
                a = spectra[m, t, k]
                total += a.real * a.real + a.imag * a.imag
            strongest = max(strongest, total / bins)
        least = floor * strongest + np.float32(1e-30)
        for t in range(instants):
            for k in range(bins):
                a = spectra[m, t, k]
                power = a.real * a.real + a.imag * a.imag
                past = max(memory[m, k], noise)
                news = max(power - past, np.float32(0.0))
                kept += news
                all_of_it += power
                weight = news / ((power + np.float32(1e-30)) * math.sqrt(power + least))
                spectra[m, t, k] = a * np.float32(weight)
                memory[m, k] = max(past * decay, power, noise)
    return kept / all_of_it


@njit(cache=True)
def _overlap_add(
    pieces: NDArray[np.float32],
    taper: NDArray[np.float32],
    hop: int,
    out: NDArray[np.float32],
) -> None:  # pragma: no cover  (compiled)
    channels, instants, window = pieces.shape
    for m in range(channels):
        for t in range(instants):
            for k in range(window):
                out[m, t * hop + k] += taper[k] * pieces[m, t, k]


def keep_first_wave_front(
    frame: NDArray[np.float32],
    memory: NDArray[np.float32] | None,
    sizes: EchoMemory,
    noise_density: float = 0.0,
) -> tuple[NDArray[np.float32], NDArray[np.float32], float]:
    """A frame without what may be echoes.

    Args:
        frame: (n, samples) channels, any unit.
        memory: (n, bins) what the last frame left; None after silence.
        sizes: Of window and memory.
        noise_density: Mean square of the noise a sample, were it white, units of the
            frame squared; 0 where it is not known.

    Returns:
        (n, samples) weighted and whitened channels, the new memory, and the share
        of the frame's energy that is news, 0 to 1.
    """
    windows = np.lib.stride_tricks.sliding_window_view(frame, sizes.window, axis=1)
    spectra = fft.rfft(windows[:, :: sizes.hop] * sizes.taper)
    memory = np.zeros(sizes.shape, np.float32) if memory is None else memory.copy()
    decay = np.float32(sizes.decay_a_hop)
    noise = np.float32(sizes.least(noise_density))
    news = _weigh(spectra, memory, decay, np.float32(_WHITENING_FLOOR), noise)
    pieces = fft.irfft(spectra, sizes.window, overwrite_x=True)
    out = np.zeros(frame.shape, dtype=np.float32)
    _overlap_add(pieces, sizes.taper, sizes.hop, out)
    # The last window ends before the frame does.
    rest = frame.shape[1] - sizes.hop * (spectra.shape[1] - 1)
    return out, sizes.faded(memory, rest - sizes.hop), news
