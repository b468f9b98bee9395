"""Levels at the microphones, as a witness of a source's range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.hearing.source_fix import SourceFix
from systems.sound.array_shape import ArrayShape

__all__ = ["levels_contradict"]


def levels_contradict(
    levels: NDArray[np.float64],
    fix: SourceFix,
    shape: ArrayShape,
    least_spread_db: float = 3.0,
) -> bool:
    """Whether a near source would be heard at other levels than these.

    Exchanged neighbours in a row, for one, make the delays of a source very
    near to the array. Its levels would fall as 1/R.

    Args:
        levels: (n,) RMS of the channels' sound, any unit.
        fix: A fix, with a range or without.
        shape: The n microphones.
        least_spread_db: Spread of 1/R below which nothing is claimed, dB.

    Returns:
        True where the levels follow less than half of what 1/R asks for.
    """
    if not fix.range_valid:
        return False
    ranges = np.linalg.norm(shape.p_AM - fix.p_AS, axis=1)
    expected = -20.0 * np.log10(np.maximum(ranges, 1e-3))
    if np.ptp(expected) < least_spread_db:
        return False
    expected -= expected.mean()
    measured = 20.0 * np.log10(np.maximum(levels, 1e-300))
    return bool(measured @ expected < 0.5 * (expected @ expected))
