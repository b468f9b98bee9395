"""Sound that comes in as it is made: from a pipe, a file, or a sound card."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

__all__ = ["SAMPLE_FORMATS", "SoundStream", "SoundTrouble", "open_card", "open_pipe"]

SampleFormat = Literal["s16le", "s24le", "s32le", "f32le"]

#: Names of raw samples, as other programs use them, and their bytes.
SAMPLE_FORMATS: dict[SampleFormat, int] = {
    "s16le": 2,
    "s24le": 3,
    "s32le": 4,
    "f32le": 4,
}

# Blocks are this long, s: short beside a step of the listener.
_BLOCK_S = 0.02

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_MOST_HEADER = 2**16


@dataclass
class SoundTrouble:
    """What went wrong on the way, for the end to tell."""

    overruns: int = 0
    """Times at which samples were lost."""
    cut: bool = False
    """Whether the stream ended within a sample of all channels."""


@dataclass(frozen=True)
class SoundStream:
    """Samples of all channels, block after block."""

    channels: int
    sample_rate_hz: int
    blocks: Iterator[NDArray[np.float32]] = field(repr=False)
    """(channels, k) each, full scale 1."""
    trouble: SoundTrouble


def open_pipe(
    pipe: BinaryIO,
    *,
    channels: int,
    sample_rate_hz: int | None = None,
    sample_format: SampleFormat = "s16le",
) -> SoundStream:
    """Sound from a pipe or a file: WAV, or raw samples of all channels in turn.

    Args:
        pipe: Read to its end, and never sought in.
        channels: Of raw samples; a WAV header says its own.
        sample_rate_hz: Of raw samples, Hz.
        sample_format: Of raw samples.

    Returns:
        The stream.

    Raises:
        InputError: It is empty, its WAV header is of another kind, or it is raw and
            nobody says its rate.
    """
    start = pipe.read(4)
    if not start:
        raise InputError("input", "it is empty; pipe in WAV or raw samples")
    if start == b"RIFF":
        channels, sample_rate_hz, sample_format = _wav_header(pipe)
        start = b""
    if sample_rate_hz is None:
        raise InputError(
            "input", "it is no WAV; say what it is, as --rate 48000 --format s16le"
        )
    trouble = SoundTrouble()
    blocks = _raw_blocks(pipe, start, channels, sample_rate_hz, sample_format, trouble)
    return SoundStream(channels, sample_rate_hz, blocks, trouble)


def open_card(
    device: str | int | None, *, channels: int, sample_rate_hz: int
) -> SoundStream:
    """Sound from a sound card, by the ``sounddevice`` package.

    Args:
        device: Its name, or a part of it, or its number; None: the default one.
        channels: To record.
        sample_rate_hz: Hz.

    Returns:
        The stream, which has no end.

    Raises:
        InputError: The package or the device is missing, or it cannot record so.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise InputError(
            "--device",
            f"sound cards need the sounddevice package and PortAudio ({error}); "
            "install phonotaxis[live], or pipe sound in",
        ) from None
    try:
        sounddevice.check_input_settings(
            device=device, channels=channels, samplerate=sample_rate_hz
        )
    except (sounddevice.PortAudioError, ValueError) as error:
        raise InputError(
            "--device",
            f"cannot record {channels} channels at {sample_rate_hz} Hz ({error}); "
            "python -m sounddevice lists the devices",
        ) from None
    trouble = SoundTrouble()

    def blocks() -> Iterator[NDArray[np.float32]]:
        size = round(_BLOCK_S * sample_rate_hz)
        with sounddevice.InputStream(
            samplerate=sample_rate_hz, device=device, channels=channels, dtype="float32"
        ) as card:
            while True:
                samples, lost = card.read(size)
                trouble.overruns += int(lost)
                yield samples.T

    return SoundStream(channels, sample_rate_hz, blocks(), trouble)


def _wav_header(pipe: BinaryIO) -> tuple[int, int, SampleFormat]:
    """Reads up to the samples; their length is that of the pipe."""
    _exactly(pipe, 4)
    if _exactly(pipe, 4) != b"WAVE":
        raise InputError("input", "it begins like a WAV and is none; convert it")
    found = None
    for _ in range(_MOST_HEADER // 8):
        name, size = struct.unpack("<4sI", _exactly(pipe, 8))
        if name == b"data":
            break
        chunk = _exactly(pipe, size + size % 2) if size < _MOST_HEADER else b""
        if name == b"fmt ":
            found = chunk
    if found is None or len(found) < 16:
        raise InputError("input", "the WAV header is not whole; record it again")
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
            f"the WAV has {bits} bits of kind {kind}; convert it to 16, 24 or 32 bits",
        )
    return channels, rate, formats[kind, bits]


def _exactly(pipe: BinaryIO, size: int) -> bytes:
    data = pipe.read(size)
    if len(data) < size:
        raise InputError("input", "it ends within the WAV header; record it again")
    return data


def _raw_blocks(
    pipe: BinaryIO,
    left: bytes,
    channels: int,
    sample_rate_hz: int,
    sample_format: SampleFormat,
    trouble: SoundTrouble,
) -> Iterator[NDArray[np.float32]]:
    width = channels * SAMPLE_FORMATS[sample_format]
    size = width * max(1, round(_BLOCK_S * sample_rate_hz))
    while True:
        data = left + pipe.read(size - len(left))
        whole = len(data) - len(data) % width
        if whole:
            yield _samples(data[:whole], sample_format).reshape(-1, channels).T
        left = data[whole:]
        if len(data) < size:
            trouble.cut = bool(left)
            return


def _samples(data: bytes, sample_format: SampleFormat) -> NDArray[np.float32]:
    """Full scale 1."""
    if sample_format == "f32le":
        return np.frombuffer(data, dtype="<f4").astype(np.float32)
    if sample_format == "s16le":
        return np.frombuffer(data, dtype="<i2").astype(np.float32) / np.float32(2**15)
    if sample_format == "s32le":
        return np.frombuffer(data, dtype="<i4").astype(np.float32) / np.float32(2**31)
    wide = np.zeros((len(data) // 3, 4), dtype=np.uint8)
    wide[:, 1:] = np.frombuffer(data, dtype=np.uint8).reshape(-1, 3)
    return wide.view("<i4")[:, 0].astype(np.float32) / np.float32(2**31)
