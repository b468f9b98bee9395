"""Corrects faulty channels of a recording, or rejects the recording."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from analysis.recordings.channel_faults import ChannelFault
from analysis.recordings.channel_order import exchanged
from systems.framework.input_error import InputError

# Kinds of faults that make it impossible to locate a source.
_FATAL = ("nan", "dead", "copied", "units", "drift")

# Largest number of channels in one message.
_MOST_NAMED = 8


def channels_without_faults(
    samples: NDArray[np.float64],
    faults: list[ChannelFault],
    agreement: Callable[[NDArray[np.float64]], float],
    where: str,
) -> tuple[NDArray[np.float64], list[ChannelFault]]:
    """Corrects inverted channels, and rejects recordings with serious faults.

    Exchanged channels are not corrected. Either the cables or the geometry file may be
    wrong, and only the user can know which.

    Args:
        samples: (n, samples) recorded samples, one row per microphone.
        faults: Possible faults of the channels.
        agreement: Function that measures how well channels fit the geometry. A larger
            value means a better fit.
        where: Name of the recording, which begins a message.

    Returns:
        samples: The corrected channels.
        faults: The faults that remain worth reporting.

    Raises:
        InputError: Channels are dead, not finite, copied, exchanged, or drift apart. Or
            the positions are not in meters.
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
    """Returns whether exchanging two of the channels improves the fit of all delays."""
    as_given = agreement(samples)
    return any(
        agreement(exchanged(samples, a, b)) > as_given
        for a, b in combinations(channels, 2)
    )
