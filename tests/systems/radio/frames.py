"""Frames as bytes, for tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from systems.radio.codec import FRAME_BYTES, read_frame, write_frame


class Frame(NamedTuple):
    """Address, number of the function, and value."""

    address: int
    function: int
    value: float


def encode(*frames: Frame) -> list[float]:
    """The bytes of frames, one after the other."""
    out = [0.0] * (FRAME_BYTES * len(frames))
    for k, frame in enumerate(frames):
        write_frame(out, FRAME_BYTES * k, *frame)
    return out


def decode(data: Sequence[float]) -> list[Frame]:
    """The frames in bytes."""
    return [Frame(*read_frame(data, k)) for k in range(0, len(data), FRAME_BYTES)]
