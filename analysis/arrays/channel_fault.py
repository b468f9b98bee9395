"""Defines a fault of the channels of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

#: What is wrong.
FaultKind = Literal[
    "nan", "dead", "apart", "copied", "clipped", "inverted", "directional", "swapped",
    "near", "geometry", "units", "speed", "size", "late", "unaligned", "slipped",
    "drift", "moves", "tone", "reflector", "echo"
]  # fmt: skip


@dataclass(frozen=True)
class ChannelFault:
    """A fault of one or more channels, or of the description of the array."""

    kind: FaultKind
    channels: tuple[int, ...]
    """Numbers of the faulty channels, from 0. Empty if the fault concerns all channels.
    """
    message: str
    """One line with the observation and the remedy. It counts channels from 1."""


def channel_names(channels: Sequence[int]) -> str:
    """Returns text such as ``channels 2 and 3`` for channels that count from 0."""
    word = "channel" if len(channels) == 1 else "channels"
    *first, last = [str(k + 1) for k in channels]
    return f"{word} {', '.join(first)} and {last}" if first else f"{word} {last}"
