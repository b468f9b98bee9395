"""Reads a stream of sound from a pipe or a file.

The sound is WAV or raw samples. Raw samples are interleaved: one sample of each
channel in turn.
"""

from __future__ import annotations

import os
import re
import select
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.sound_stream import (
    BLOCK_S,
    SILENT_AFTER_S,
    STOPPED,
    Pace,
    SoundBlock,
    SoundStream,
    StreamBrokenError,
    check_stated,
    truncated_fault,
)
from systems.framework.input_error import InputError
from systems.sound.wav_lengths import states_length

SampleFormat = Literal["s16le", "s24le", "s32le", "f32le"]

# Formats of raw samples, by the names that other programs use. Each has a number of
# bytes per sample, the type of the numbers, and their full scale. A sample of 24 bits
# is converted to the high bytes of 32 bits.
_FORMATS: dict[SampleFormat, tuple[int, str, float]] = {
    "s16le": (2, "<i2", 2.0**15),
    "s24le": (3, "<i4", 2.0**31),
    "s32le": (4, "<i4", 2.0**31),
    "f32le": (4, "<f4", 1.0),
}

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_MOST_HEADER, _MOST_CHUNKS = 2**16, 64

# _BEGIN: first bytes of a further WAV in the stream.
# _BEGIN_SIZE: number of these bytes.
# _BEGIN_AT_END: a possible incomplete beginning at the end of the data.
_BEGIN, _BEGIN_SIZE = re.compile(rb"RIFF.{4}WAVEfmt ", re.DOTALL), 16
_BEGIN_AT_END = re.compile(rb"RIFF|RIF$|RI$|R$")

# First bytes of files that are neither WAV nor raw samples, and the text of the
# message.
_OTHERS = {
    b"fLaC": "FLAC; name the file, or decode it: flac -dc FILE.flac |",
    b"OggS": "Ogg; decode it: ffmpeg -i FILE -f wav - |",
    b"RIFX": "a WAV of big-endian samples; convert it: sox FILE -t wav - |",
    b"RF64": "an RF64 file; convert it: ffmpeg -i FILE -f wav - |",
    b"FORM": "AIFF; convert it: sox FILE -t wav - |",
    b"ID3\x03": "MP3; decode it: ffmpeg -i FILE -f wav - |",
    b"ID3\x04": "MP3; decode it: ffmpeg -i FILE -f wav - |",
}


class _Format(NamedTuple):
    channels: int
    sample_rate_hz: int
    samples: SampleFormat

    @property
    def width(self) -> int:
        """Bytes of one sample of all channels."""
        return self.channels * _FORMATS[self.samples][0]

    def __str__(self) -> str:
        return f"{self.channels} channels, {self.sample_rate_hz} Hz, {self.samples}"


def open_pipe(
    pipe: BinaryIO,
    *,
    raw_channels: int,
    channels: int | None = None,
    sample_rate_hz: int | None = None,
    sample_format: SampleFormat = "s16le",
) -> SoundStream:
    """Opens a stream from a pipe or file, which is read to its end without seeking.

    The stream owns and closes the pipe, which must have a file descriptor. Without
    ``channels``, the WAV header states the number of channels, and raw samples have
    ``raw_channels``. Raises ``InputError`` if the input is empty, if its WAV header is
    invalid or contradicts the stated values, or if the input is raw and no sample rate
    is stated.
    """
    with ExitStack() as stack:
        stack.callback(pipe.close)
        source = _Source(pipe)
        raw = None
        if sample_rate_hz is not None:
            raw = _Format(channels or raw_channels, sample_rate_hz, sample_format)
        form, length = _begin(source, raw)
        if form is not raw:
            check_stated(form.channels, form.sample_rate_hz, channels, sample_rate_hz)
        stack.pop_all()
    blocks = _blocks(source, form, length)
    return SoundStream(form.channels, form.sample_rate_hz, blocks, pipe.close)


def _begin(source: _Source, raw: _Format | None) -> tuple[_Format, int | None]:
    """Reads the beginning of the input up to the samples.

    Returns the format of the samples, which is ``raw`` if there is no header, and their
    number of bytes, or None if it is unknown.
    """
    start = source.read(4)
    if not start:
        raise InputError("input", "it is empty; pipe in WAV or raw samples")
    if start in _OTHERS:
        raise InputError("input", f"it is {_OTHERS[start]} phonotaxis listen")
    if start == b"RIFF":
        return _wav_header(source)
    if raw is None:
        raise InputError(
            "input",
            "it is not a WAV file; state its format, for example --rate 48000 "
            "--format s16le",
        )
    source.unread(start)
    return raw, None


class _Source:
    """Reads bytes from a pipe or file, and measures the time spent waiting for them."""

    def __init__(self, pipe: BinaryIO) -> None:
        self._descriptor = pipe.fileno()
        self._unread = b""
        self.waited_s = 0.0
        self.missing = 0
        """Bytes that a WAV header states beyond the end of the input."""

    def unread(self, data: bytes) -> None:
        """Puts bytes back, so that they are read next."""
        self._unread = data + self._unread

    def some(self, size: int) -> bytes | None:
        """Reads up to ``size`` bytes.

        Returns no bytes at the end of the input, and None if nothing has arrived for 1
        s.
        """
        if self._unread:
            data, self._unread = self._unread[:size], self._unread[size:]
            return data
        begun = time.monotonic()
        ready, _, _ = select.select([self._descriptor], [], [], SILENT_AFTER_S)
        self.waited_s += time.monotonic() - begun
        return os.read(self._descriptor, size) if ready else None

    def read(self, size: int) -> bytes:
        """Reads ``size`` bytes, or all bytes to the end if there are fewer."""
        data = b""
        while len(data) < size:
            more = self.some(size - len(data))
            if more == b"":
                break
            data += more or b""
        return data


def _wav_header(source: _Source) -> tuple[_Format, int | None]:
    """Reads a WAV header after the bytes RIFF, up to the samples.

    Returns the format and the number of bytes of the samples, or None if the header
    does not state the number.
    """
    _exactly(source, 4)
    if _exactly(source, 4) != b"WAVE":
        raise InputError(
            "input", "it begins like a WAV file but is not one; convert it"
        )
    found = None
    for _ in range(_MOST_CHUNKS):
        name, size = struct.unpack("<4sI", _exactly(source, 8))
        if name == b"data":
            break
        if size > _MOST_HEADER:
            raise InputError("input", "the WAV header is incomplete; record it again")
        chunk = _exactly(source, size + size % 2)
        if name == b"fmt ":
            found = chunk
    if found is None or len(found) < 16:
        raise InputError("input", "the WAV header is incomplete; record it again")
    kind, channels, rate, _, _, bits = struct.unpack("<HHIIHH", found[:16])
    if kind == _EXTENSIBLE and len(found) >= 26:
        kind = struct.unpack("<H", found[24:26])[0]
    formats: dict[tuple[int, int], SampleFormat] = {
        (_PCM, 16): "s16le",
        (_PCM, 24): "s24le",
        (_PCM, 32): "s32le",
        (_FLOAT, 32): "f32le",
    }
    if (kind, bits) not in formats or not channels:
        raise InputError(
            "input",
            f"the WAV has {channels} channels of {bits} bits of kind {kind}; convert "
            "it to 16, 24 or 32 bits",
        )
    form = _Format(channels, rate, formats[kind, bits])
    return form, size if states_length(size) else None


def _exactly(source: _Source, size: int) -> bytes:
    data = source.read(size)
    if len(data) < size:
        raise InputError("input", "it ends within the WAV header; record it again")
    return data


def _blocks(source: _Source, form: _Format, length: int | None) -> Iterator[SoundBlock]:
    """Yields blocks of samples, including those of further WAV files in the stream.

    A block without samples reports a pause or an incomplete end.
    """
    pace, gap, cut = Pace(form.sample_rate_hz), False, 0
    for data in _chunks(source, form, length):
        if data is None:
            if not gap:
                yield SoundBlock(_samples(b"", form), (STOPPED,))
            gap = True
            pace.begin()
            continue
        cut = len(data) % form.width
        whole = data[: len(data) - cut]
        faults = pace.came(len(whole) // form.width, source.waited_s)
        source.waited_s = 0.0
        yield SoundBlock(_samples(whole, form), faults, gap)
        gap = False
    last: tuple[str, ...] = ()
    if cut:
        last += ("the stream ended within a sample of all channels",)
    if source.missing >= form.width:
        missing = source.missing // form.width
        last += (truncated_fault(missing, form.sample_rate_hz),)
    if last:
        yield SoundBlock(_samples(b"", form), last)


def _chunks(
    source: _Source, form: _Format, length: int | None
) -> Iterator[bytes | None]:
    """Yields the bytes of whole samples, or None if nothing has arrived for 1 s.

    Only the last bytes may be incomplete.
    """
    most = form.width * max(1, round(BLOCK_S * form.sample_rate_hz))
    while True:
        data = b""
        size = most if length is None else min(most, length - length % form.width)
        while len(data) < size:
            more = source.some(size - len(data))
            if more == b"":
                source.missing = 0 if length is None else length - len(data)
                if data:
                    yield data
                return
            if more is None:
                yield None
            data += more or b""
        if length is None:
            if _BEGIN_AT_END.search(data[1 - _BEGIN_SIZE :]):
                data += source.read(form.width * -(-_BEGIN_SIZE // form.width))
            if again := _BEGIN.search(data):
                yield data[: again.start() - again.start() % form.width]
                source.unread(data[again.start() + 4 :])
                length = _another(source, form)
                continue
        yield data
        if length is None:
            continue
        length -= len(data)
        if length < form.width:
            source.read(length + length % 2)
            if not _reaches_another(source):
                return
            length = _another(source, form)


def _reaches_another(source: _Source) -> bool:
    """Skips the chunks after a WAV's samples. Returns whether another WAV begins."""
    while (name := source.read(4)) != b"RIFF":
        size = source.read(4)
        if len(name + size) < 8:
            return False
        count = struct.unpack("<I", size)[0]
        source.read(count + count % 2)
    return True


def _another(source: _Source, form: _Format) -> int | None:
    """Reads the header of a further WAV. Returns the number of bytes of its samples."""
    other, length = _wav_header(source)
    if other != form:
        # Times and delays are counted in samples, so the rate must not change.
        raise StreamBrokenError(
            f"the stream changes from {form} to {other}; listen to the second part by "
            "itself"
        )
    return length


def _samples(data: bytes, form: _Format) -> NDArray[np.float32]:
    """Converts bytes to (channels, k) samples; full scale is 1."""
    width, kind, full_scale = _FORMATS[form.samples]
    if width == 3:
        wide = np.zeros((len(data) // 3, 4), dtype=np.uint8)
        wide[:, 1:] = np.frombuffer(data, dtype=np.uint8).reshape(-1, 3)
        data = wide.tobytes()
    numbers = np.frombuffer(data, kind).astype(np.float32) / np.float32(full_scale)
    return numbers.reshape(-1, form.channels).T
