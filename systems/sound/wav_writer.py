"""Writing sound as it comes, into WAV files that can be read at any moment."""

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

#: Bytes of samples, at most: the header counts them, and itself, with 32 bits.
LARGEST_WAV_BYTES = 2**32 - 1000


def pcm_of_counts(counts: NDArray[np.int16], full_scale: int) -> NDArray[np.int16]:
    """Samples of 16 bits for counts of a converter.

    Args:
        counts: (channels, n) from -full_scale to full_scale - 1.
        full_scale: A power of two, up to 2^15.

    Returns:
        (channels, n) the counts times a power of two: full scale stays full scale, and
        the counts can be had back exactly.
    """
    return counts * np.int16(2**15 // full_scale) if full_scale < 2**15 else counts


def loudest_pa(level_pa: float) -> float:
    """Pressure that is full scale in a file of what a loudspeaker plays.

    Args:
        level_pa: RMS pressure at 1 m while it sounds, Pa.

    Returns:
        The least power of two, Pa, that the loudspeaker's peaks do not exceed.
    """
    return 2.0 ** math.ceil(math.log2(LARGEST_CREST * level_pa))


def pcm_of_pressure(
    pressure: NDArray[np.float32], full_scale_pa: float
) -> NDArray[np.int32]:
    """Samples of 32 bits for sound pressure.

    Args:
        pressure: (n,) Pa.
        full_scale_pa: Pressure that is full scale, Pa.

    Returns:
        (n,) rounded to 2^-31 of full scale, and clipped.
    """
    scaled = np.rint(pressure.astype(np.float64) * (2**31 / full_scale_pa))
    return np.clip(scaled, -(2**31), 2**31 - 1).astype(np.int32)


class WavWriter:
    """A WAV file that grows.

    After each ``write`` its header says how long it is: whatever stops the process,
    what was written can be read.

    Args:
        path: A file that does not exist yet.
        channels: Number of channels.
        rate_hz: Of each channel, Hz.
        sample_bytes: 2 or 4, of a sample.

    Raises:
        OSError: The file exists, or cannot be made.
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
            samples: (channels, n) whole numbers of the file's size.

        Raises:
            OSError: The disk is full, or fails; names the file.
        """
        interleaved = np.ascontiguousarray(samples.T, dtype=self._kind)
        with self._named():
            self._wave.writeframes(interleaved.tobytes())
        self.samples += len(interleaved)

    def close(self) -> None:
        """Ends the file.

        Raises:
            OSError: The disk fails, and has not done so before.
        """
        failed_before = self._failed
        for close in (self._wave.close, self._file.close):
            try:
                with self._named():
                    close()
            except OSError:
                # The buffer holds what could not be written: it was told of.
                if not failed_before:
                    self._file.close()
                    raise

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Errors name the file."""
        try:
            yield
        except OSError as error:
            self._failed = True
            raise OSError(error.errno, error.strerror, str(self.path)) from None
