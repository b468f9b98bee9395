"""Largest multiple of a box of uncertain parameters in which loops stay stable.

The scale is bounded from below by a proof (``zero_exclusion``), and from above by
unstable parameters that were found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.loops.growth_bound import MOST_PARTS, Family
from systems.framework.input_error import InputError

#: Largest scale that is examined.
_MOST_SCALE = 10.0
#: A parameter that is positive in the box stays above this share of its nominal value.
_LEAST_SHARE = 0.05
#: Smallest scale that is examined.
_SMALLEST = 1e-3

Vector = NDArray[np.float64]
FamiliesOf = Callable[[Vector, Vector], Sequence[Family]]


@dataclass(frozen=True)
class StableScale:
    """Scale of a box about its nominal parameters, from both sides.

    At scale 1, the box is the given one.
    """

    proven: float
    """Scale up to which all loops are proven stable; 0 if none is."""
    unstable: float
    """Smallest scale with an unstable loop that was found; infinite if none was."""
    largest: float
    """Largest scale that was examined: 10, or the scale at which a parameter with a
    fixed sign has only 5 % of its nominal value left."""


def stable_scale(
    families_of: FamiliesOf,
    low: Vector,
    nominal: Vector,
    high: Vector,
    *,
    close: float = 1.002,
) -> StableScale:
    """Bounds the largest scale of a box in which all loops are stable.

    Args:
        families_of: Returns the loops in a box, from its (p,) lower and upper ends.
        low: (p,) lower ends of the box at scale 1.
        nominal: (p,) parameters about which the box is scaled.
        high: (p,) upper ends of the box at scale 1.
        close: Ratio of the two bounds at which the search ends, if each proof succeeds.

    Returns:
        The scale from both sides.
    """
    largest = _largest(low, nominal, high)
    proven, unstable = 0.0, math.inf
    top, scale = math.inf, largest  # at top, stability is not proven
    while proven < largest and top > max(close * proven, _SMALLEST):
        ends = [nominal + scale * (end - nominal) for end in (low, high)]
        outcome = _outcome(families_of, *ends)
        if outcome == "stable":
            proven = scale
        else:
            top = scale
        if outcome == "unstable":
            unstable = scale
        first = proven == 0.0 and top == largest
        scale = _SMALLEST if first else 0.5 * (proven + top)
    return StableScale(proven, unstable, largest)


def _outcome(
    families_of: FamiliesOf, low: Vector, high: Vector
) -> Literal["stable", "unstable", "undecided"]:
    try:
        families = families_of(low, high)
        found = [_stable(family) for family in families]
    except InputError:  # far from the nominal parameters, a loop may not exist
        return "undecided"
    if False in found:
        return "unstable"
    return "undecided" if None in found else "stable"


def _stable(family: Family) -> bool | None:
    """Whether all loops are proven stable; None if undecided."""
    growth, place = family.worst_corner(np.full(len(family.low), 0.5))
    if growth >= 0.0:
        return False
    pole = family.growth_at(place)[1]
    result = family.exclude(0.0, abs(pole.imag) or abs(pole), MOST_PARTS)
    return {"excluded": True, "counterexample": False, "open": None}[result.outcome]


def _largest(low: Vector, nominal: Vector, high: Vector) -> float:
    room = [_MOST_SCALE]
    for least, middle, most in zip(low, nominal, high, strict=True):
        inner = min(abs(least), abs(most))
        if least * most > 0.0 and abs(middle) > inner:
            room.append((1.0 - _LEAST_SHARE) * abs(middle) / (abs(middle) - inner))
    return float(min(room))
