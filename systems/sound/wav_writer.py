"""Writes sound continuously into WAV files that can be read at any time."""

from __future__ import annotations

import math
import wave
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.sound.waveforms import LARGEST_CREST

#: Largest number of bytes of samples. The header stores the size of the file and the
#: size of the samples with 32 bits each.
LARGEST_WAV_BYTES = 2**32 - 1000


def pcm_of_counts(counts: NDArray[np.int16], full_scale: int) -> NDArray[np.int16]:
    """Converts counts of an A/D converter to samples of 16 bits.

    Args:
        counts: (channels, n) counts from -full_scale to full_scale - 1.
        full_scale: Full scale of the converter in counts; a power of two, up to 2^15.

    Returns:
        (channels, n) counts multiplied by 2^15 / full_scale. The factor is a power of
        two, so the counts can be restored exactly.
    """
    return counts * np.int16(2**15 // full_scale) if full_scale < 2**15 else counts


def loudest_pa(level_pa: float) -> float:
    """Returns the sound pressure that is full scale in a loudspeaker's sound file, Pa.

    The result is the smallest power of two that the peaks of the sound do not exceed.
    ``level_pa`` is the RMS pressure at 1 m during a burst of the sound, Pa.
    """
    return 2.0 ** math.ceil(math.log2(LARGEST_CREST * level_pa))


def pcm_of_pressure(
    pressure: NDArray[np.float32], full_scale_pa: float
) -> NDArray[np.int32]:
    """Converts sound pressure to samples of 32 bits, rounded and clipped.

    Args:
        pressure: (n,) sound pressure, Pa.
        full_scale_pa: Pressure at full scale (2^31), Pa.

    Returns:
        (n,) samples.
    """
    scaled = np.rint(pressure.astype(np.float64) * (2**31 / full_scale_pa))
    return np.clip(scaled, -(2**31), 2**31 - 1).astype(np.int32)


class WavWriter:
    """Writes a WAV file piece by piece.

    After each ``write``, the header states the present length. Even if the process
    stops suddenly, the samples written so far can therefore be read.

    Args:
        path: A file that does not exist yet.
        channels: Number of channels.
        rate_hz: Sample rate of each channel, Hz.
        sample_bytes: Number of bytes of a sample, 2 or 4.

    Raises:
        OSError: The file exists, or cannot be created.
    """

    def __init__(
        self, path: Path, channels: int, rate_hz: int, sample_bytes: int
    ) -> None:
        self.path, self.samples = path, 0
        self._kind = np.dtype(f"<i{sample_bytes}")
        self._failed = False
        self._file = path.open("xb")
        self._wave: Any = wave.open(self._file, "wb")  # noqa: SIM115  # it grows
        self._wave.setnchannels(channels)
        self._wave.setframerate(rate_hz)
        self._wave.setsampwidth(sample_bytes)
        with self._named():
            self._wave.writeframes(b"")

    def write(self, samples: NDArray[Any]) -> None:
        """Appends samples.

        Args:
            samples: (channels, n) integers that fit the sample size of the file.

        Raises:
            OSError: The disk is full or fails. The error names the file.
        """
        interleaved = np.ascontiguousarray(samples.T, dtype=self._kind)
        with self._named():
            self._wave.writeframes(interleaved.tobytes())
        self.samples += len(interleaved)

    def close(self) -> None:
        """Closes the file.

        Raises:
            OSError: The disk fails, and no earlier error was raised.
        """
        failed_before = self._failed
        for close in (self._wave.close, self._file.close):
            try:
                with self._named():
                    close()
            except OSError:
                # The buffer holds samples that could not be written. If ``write`` has
                # raised this error before, it is not raised again.
                if not failed_before:
                    self._file.close()
                    raise

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Adds the name of the file to errors of the operating system."""
        try:
            yield
        except OSError as error:
            self._failed = True
            raise OSError(error.errno, error.strerror, str(self.path)) from None
