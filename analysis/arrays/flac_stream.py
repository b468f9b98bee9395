"""Reads a stream of sound from a FLAC file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import soundfile

from analysis.arrays.sound_stream import (
    BLOCK_S,
    SoundBlock,
    SoundStream,
    check_stated,
    truncated_fault,
)
from systems.framework.input_error import InputError
from systems.sound.sound_file import UNKNOWN_FRAMES


def open_flac(
    path: Path, *, channels: int | None = None, sample_rate_hz: int | None = None
) -> SoundStream:
    """Opens a stream from a FLAC file.

    Raises ``InputError`` if the file cannot be decoded or contradicts the stated
    values.
    """
    try:
        sound = soundfile.SoundFile(path)
    except soundfile.SoundFileError as error:
        raise InputError(
            "input", f"cannot be decoded ({error}); record it again"
        ) from None
    with ExitStack() as stack:
        stack.callback(sound.close)
        check_stated(sound.channels, sound.samplerate, channels, sample_rate_hz)
        stack.pop_all()
    return SoundStream(sound.channels, sound.samplerate, _blocks(sound), sound.close)


def _blocks(sound: soundfile.SoundFile) -> Iterator[SoundBlock]:
    """Yields blocks of samples up to the end of the file, or up to damage in it."""
    size, count = round(BLOCK_S * sound.samplerate), 0
    try:
        while len(samples := sound.read(size, dtype="float32", always_2d=True)):
            yield SoundBlock(samples.T)
            count += len(samples)
    except soundfile.SoundFileError:
        pass  # the count shows how much is missing
    if count < sound.frames != UNKNOWN_FRAMES:
        fault = truncated_fault(sound.frames - count, sound.samplerate)
        yield SoundBlock(np.empty((sound.channels, 0), np.float32), (fault,))
