"""Channels of a recording that are not as they should be."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.channel_faults import ChannelFault
from analysis.recordings.channel_order import exchanged
from systems.framework.input_error import InputError

# What leaves nothing to locate with.
_FATAL = ("nan", "dead", "copied", "units", "drift")

# Channels that one message names.
_MOST_NAMED = 8


def channels_without_faults(
    samples: NDArray[np.float64],
    faults: list[ChannelFault],
    agreement: Callable[[NDArray[np.float64]], float],
    where: str,
) -> tuple[NDArray[np.float64], list[ChannelFault]]:
    """Mends what can be mended, and refuses what would give wrong places.

    An inverted channel is turned back. Exchanged channels are no guess to be
    made here: whether the cables or the file's description are wrong is for the
    user to say.

    Args:
        samples: (n, samples) one row a microphone.
        faults: What seems wrong with them.
        agreement: How well channels fit the geometry; the higher the better.
        where: Begins a message.

    Returns:
        The channels, and the faults that remain worth saying.

    Raises:
        InputError: Channels are dead, not finite, copies, or exchanged; or positions
            are not in metres.
    """
    fatal = [fault for fault in faults if fault.kind in _FATAL]
    if fatal:
        first, *rest = fatal
        further = sorted({k + 1 for f in rest for k in f.channels if f is not first})
        names = ", ".join(map(str, further[:_MOST_NAMED]))
        names += " ..." if len(further) > _MOST_NAMED else ""
        more = f"; check channels {names} as well" if rest else ""
        raise InputError("recording", f"{where}: {first.message}{more}")
    inverted = [k for f in faults if f.kind == "inverted" for k in f.channels]
    if inverted:
        samples = samples.copy()
        samples[inverted] *= -1.0
    kept = []
    for fault in faults:
        if fault.kind != "swapped":
            kept.append(fault)
        elif _fits_better_exchanged(samples, fault.channels, agreement):
            raise InputError("recording", f"{where}: {fault.message}")
    return samples, kept


def _fits_better_exchanged(
    samples: NDArray[np.float64],
    channels: tuple[int, ...],
    agreement: Callable[[NDArray[np.float64]], float],
) -> bool:
    """Whether some exchange makes all delays fit better, not the peaks alone."""
    as_given = agreement(samples)
    return any(
        agreement(exchanged(samples, a, b)) > as_given
        for a, b in combinations(channels, 2)
    )
