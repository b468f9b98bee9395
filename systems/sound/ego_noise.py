"""Noise of the robot itself, from a recording."""

from __future__ import annotations

from copy import copy

import numpy as np
import soxr
from numpy.typing import NDArray

from systems.framework.input_error import InputError
from systems.framework.noise import BEFORE_THE_RUN, tick_generator
from systems.framework.signals import SAMPLE_RATE_HZ
from systems.sound.parameters import MICROPHONE_BAND_HZ, MicArrayParameters
from systems.sound.sound_file import read_noise
from systems.sound.waveforms import band_limited

#: The end of the recording fades into its beginning over this time, s.
FADE_S = 0.05


class EgoNoise:
    """Noise of the robot's motors and fans, which is added to each channel.

    The level of the noise is constant. The recording of the noise is resampled to the
    sample rate, limited to the band of the microphones, and repeated without a seam.

    If the recording has one channel per microphone, all channels start at the same
    random position in the recording, so that they stay coherent. If the recording has a
    single channel, each microphone starts at its own random position in this channel,
    so that the microphones hear incoherent noise.

    Args:
        parameters: File and level of the noise.
        count: Number of microphones n.
        seed: Seed of the start positions.

    Raises:
        InputError: The file cannot be used. The message names the file and the remedy.
    """

    def __init__(self, parameters: MicArrayParameters, count: int, seed: int) -> None:
        self._loops = _read_loops(
            parameters.ego_noise_file or "", count, parameters.sample_rate_hz
        )
        self._samples = parameters.frame_samples
        self._level = 10.0 ** (-parameters.ego_noise_snr_db_at_1m / 20.0)
        together = len(self._loops) > 1
        self._rows = np.arange(count) if together else np.zeros(count, dtype=int)
        self._starts = self._drawn_starts(seed)

    def _drawn_starts(self, seed: int) -> NDArray[np.int64]:
        """Draws the (n,) positions in the recording at which the channels start."""
        count = len(self._rows)
        starts = tick_generator(seed, BEFORE_THE_RUN + 1).integers(
            self._loops.shape[1], size=count
        )
        return np.full(count, starts[0]) if len(self._loops) > 1 else starts

    def of_seed(self, seed: int) -> EgoNoise:
        """Returns the noise of the same recording with other start positions."""
        other = copy(self)
        other._starts = self._drawn_starts(seed)
        return other

    def frame(self, number: int) -> NDArray[np.float32]:
        """Returns the noise in one audio frame.

        Args:
            number: Number of the frame. Frame 0 ends at time zero.

        Returns:
            (n, samples) pressure divided by the RMS pressure of the source at 1 m.
        """
        first = self._starts + (number - 1) * self._samples
        places = (first[:, None] + np.arange(self._samples)) % self._loops.shape[1]
        return np.float32(self._level) * self._loops[self._rows[:, None], places]


def _read_loops(file: str, count: int, rate_hz: float) -> NDArray[np.float32]:
    """Reads (1 or n, length) samples at ``rate_hz``, of unit RMS over all channels."""
    field = "microphones.ego_noise_file"
    channels, rate = read_noise(file, count, field)
    centered = channels - channels.mean(axis=1, keepdims=True)
    resampled = soxr.resample(centered.T, rate, SAMPLE_RATE_HZ, quality="VHQ").T
    heard = np.array([band_limited(row, *MICROPHONE_BAND_HZ) for row in resampled])
    if np.std(heard) <= 1e-6 * np.abs(channels).max():
        low, high = MICROPHONE_BAND_HZ
        raise InputError(
            field,
            f"{file} has nothing between {low:g} and {high:g} Hz, which the "
            "microphones pass; choose another file",
        )
    if rate_hz != SAMPLE_RATE_HZ:
        heard = soxr.resample(heard.T, SAMPLE_RATE_HZ, rate_hz, quality="VHQ").T
    # Fade the end into the beginning, with constant power.
    fade = round(FADE_S * rate_hz)
    angle = np.pi / 2.0 * (np.arange(fade) + 0.5) / fade
    loops = heard[:, :-fade].copy()
    loops[:, :fade] *= np.sin(angle)
    loops[:, :fade] += np.cos(angle) * heard[:, -fade:]
    return (loops / np.sqrt(np.mean(loops**2))).astype(np.float32)
