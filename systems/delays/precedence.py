"""Keeps the first wave front of every sound and suppresses its echoes.

In a room, the direct sound arrives first. For some tens of milliseconds, further sound
in the same band is more likely an echo than new sound. A memory of the past spectra,
which decays, therefore represents the possible echoes.

The module computes short-time spectra of each channel and whitens them. It multiplies
each bin by the share of its power that exceeds the memory. This is the precedence
effect, as in the echo-free onsets of Huang, Ohnishi and Sugie (1995). All factors are
real, so that the delays between the channels do not change.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from systems.framework.compiling import njit

# Length of the window of a spectrum, s. It is short compared with the delay of the
# first echoes, and long compared with a period of the lowest band.
_WINDOW_S = 2.56e-3
# Number of windows that overlap at each sample.
_HOPS_PER_WINDOW = 4

# Time constant of the memory, s. The sound in a room with a reverberation time (60 dB)
# of 0.69 s decays with the same time constant. In the trials in
# docs/results_hearing.md, values from 20 to 100 ms give similar results.
_DECAY_S = 0.05

# Ratio to the noise above which power counts as new. Noise exceeds this ratio in one of
# exp(4) bins. Without this limit, whitening would raise noise to the level of the
# sound.
_NOISE_MARGIN = 4.0

# Share of the strongest power of a channel. Whitening is limited for bins below this
# share.
_WHITENING_FLOOR = 0.01


class EchoMemory:
    """Sizes and decay of the memory of past spectra, for frames of one sample rate."""

    def __init__(self, channels: int, sample_rate_hz: float) -> None:
        self.window = _HOPS_PER_WINDOW * max(
            4, round(_WINDOW_S * sample_rate_hz / _HOPS_PER_WINDOW)
        )
        self.hop = self.window // _HOPS_PER_WINDOW
        self.shape = (channels, self.window // 2 + 1)
        self.decay_a_hop = math.exp(-self.hop / sample_rate_hz / _DECAY_S)
        phase = (np.arange(self.window) + 0.5) / self.window
        # The squares of the taper add up to a constant over four hops.
        self.taper = (np.sin(np.pi * phase) * math.sqrt(0.5)).astype(np.float32)

    def faded(self, memory: NDArray[np.float32], samples: int) -> NDArray[np.float32]:
        """Returns the (n, bins) memory of past power after some silent samples."""
        return memory * np.float32(self.decay_a_hop ** (samples / self.hop))

    def least(self, noise_density: float) -> float:
        """Returns the least power in the memory for a given noise energy per sample."""
        return _NOISE_MARGIN * noise_density * float(np.vdot(self.taper, self.taper))


@njit(cache=True)
def _weigh(
    spectra: NDArray[np.complex64],
    memory: NDArray[np.float32],
    decay: np.float32,
    floor: np.float32,
    noise: np.float32,
) -> float:  # pragma: no cover  (compiled)
    """Weights (n, instants, bins) spectra in place, and updates the memory of power.

    The new power of a bin is the excess of its power over the memory. The weight is the
    share of new power. Division by the root of the power whitens the spectrum. The
    updated memory is the largest of the decayed memory, the present power, and the
    noise. The function returns the share of the energy that is new.
    """
    channels, instants, bins = spectra.shape
    kept, all_of_it = 0.0, 1e-30
    for m in range(channels):
        # Strongest instant of the channel, which limits the whitening.
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
    """Suppresses possible echoes in a frame of audio.

    Args:
        frame: (n, samples) channels, any unit.
        memory: (n, bins) memory of past power after the last frame; None after silence.
        sizes: Sizes of window and memory.
        noise_density: Mean square of the samples of white noise that is as loud as the
            noise in the frame, units of the frame squared; 0 if it is unknown.

    Returns:
        Three values: the (n, samples) weighted and whitened channels; the new memory;
        and the share of the frame's energy that is new, 0 to 1.
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
    # The last window ends before the end of the frame.
    rest = frame.shape[1] - sizes.hop * (spectra.shape[1] - 1)
    return out, sizes.faded(memory, rest - sizes.hop), news
