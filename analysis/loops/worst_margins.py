"""Smallest margins of a family of loops: the worst case found, and a proven bound.

The proofs are those of ``zero_exclusion``. For the disk margin, no factor at the border
of a disk gives L f = -1. For the delay margin, no delay of a signal gives L exp(-j w
delay) = -1. Such a proof for all parameters, frequencies, and factors or delays shows
that no pole crosses the border of stability. They hold for polynomials that describe L
up to a measured error; see ``parameter_polynomial``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from analysis.loops.loop_family import LoopFamily
from analysis.loops.loop_margins import loop_margins
from analysis.loops.multiloop_disk import multiloop_disk_margin
from analysis.loops.zero_exclusion import Exclusion

#: Largest number of parts in one proof.
MOST_PARTS = 60_000
#: Wanted difference between proven and found margin, as a share of the found margin.
_GAP = 2e-3
#: Factor by which the difference grows if a proof fails, and the number of proofs.
_WIDER, _PROOFS = 3.0, 4
#: Number of times that a counterexample may lower the found margin.
_RAISES = 10
#: Number of random points, and of random corners, from which the searches begin.
_STARTS = 40
#: Step from a corner along its edges, as a share of the interval.
_INWARD = 1e-3
#: Number of first intervals of the frequencies in a proof of a delay.
_INTERVALS = 16
#: Relative width below which an interval of frequencies adds few phases to its proof. A
#: wider interval gets few parts, and is halved if they do not suffice.
_NARROW = 2e-3
#: Largest number of parts in the proof for a wide interval, and for a narrow one.
_FEW_PARTS = 4, 2_000
#: Smallest width of an interval of frequencies, as a share of the border of stability.
_NARROWEST = 1e-5

Vector = NDArray[np.float64]
Margin = Callable[[Vector], float]


@dataclass(frozen=True)
class MarginBound:
    """Margin of the worst loop of a family, from both sides."""

    found: float
    """Smallest margin that was found; 0 if an unstable loop was found."""
    proven: float
    """Margin that every loop of the family has; 0 if nothing was proven."""
    worst: Vector
    """(p,) parameters of the worst loop that was found."""
    frequency_rad_s: float
    """Frequency of the oscillation of this loop at its margin, rad/s."""
    parts: int
    """Number of parts of the box, the frequencies and the phases in all proofs."""


def bound_disk_margin(
    family: LoopFamily, skew: float = 0.0, most_parts: int = MOST_PARTS
) -> MarginBound:
    """Bounds the smallest disk margin of a family from both sides.

    Args:
        family: The loops.
        skew: Skew of the disk, -1 to 1.
        most_parts: Largest number of parts in one proof.

    Returns:
        Sizes of the disk found and proven.
    """

    def margin(shares: Vector) -> float:
        return family.disk_at(shares, skew) if family.stable_at(shares) else 0.0

    def prove(size: float) -> Exclusion:
        return family.exclude(
            family.disturbed(skew, size),
            (-math.pi, math.pi),
            lambda shares: margin(shares) < size,
            most_parts,
        )

    bound = _bound(family, margin, prove)
    exact = multiloop_disk_margin(family.model_of(bound.worst), skew)
    return _exact(bound, exact.alpha, exact.frequency_rad_s)


def bound_delay_margin(family: LoopFamily, most_parts: int = MOST_PARTS) -> MarginBound:
    """Bounds the smallest delay margin of a family from both sides.

    The delay of a sampled loop is a whole number of periods in reality. The margin is
    that of its phase, as ``LoopMargins.delay_margin_s``: all delays of fewer periods
    are stable.

    Args:
        family: The loops.
        most_parts: Largest number of parts in one proof.

    Returns:
        Delays found and proven, s.
    """

    def margin(shares: Vector) -> float:
        if not family.stable_at(shares):
            return 0.0
        return float(family.crossovers(shares)[1].min(initial=math.inf))

    known = [family.crossovers(each) for each in _starts(family)]
    omega, delays = (np.concatenate(each) for each in zip(*known, strict=True))

    def prove(delay: float) -> Exclusion:
        def likely(low: float, high: float) -> bool:
            more = high - low if high < math.inf else 0.0
            inside = (omega >= low - more) & (omega <= high + more)
            return bool((delays[inside] * omega[inside] <= high * delay).any())

        return _prove_delay(
            family, delay, likely, lambda x: margin(x) < delay, most_parts
        )

    bound = _bound(family, margin, prove)
    exact = loop_margins(family.model_of(bound.worst))
    return _exact(bound, exact.delay_margin_s, exact.delay_frequency_rad_s)


def _prove_delay(
    family: LoopFamily,
    delay: float,
    likely: Callable[[float, float], bool],
    violates: Callable[[Vector], bool],
    most_parts: int,
) -> Exclusion:
    """Excludes that any delay up to ``delay`` gives a pole on the border of stability.

    Over an interval of frequencies, the proof admits the phases of its highest
    frequency. If these include a phase that is ``likely`` reached, or if the proof
    fails, the interval is halved.
    """
    of, parts = family.delayed(), 0
    edges = np.linspace(0.0, 1.0, _INTERVALS + 1)
    waiting = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
    while waiting:
        low, high = waiting.pop()
        ends = family.frequency(low), family.frequency(high)
        most = min(ends[1] * delay, math.tau)
        narrow = high - low < _NARROWEST or ends[0] * delay >= math.tau
        result = Exclusion("open", 0)
        if narrow or not likely(*ends):
            few = _FEW_PARTS[ends[1] <= (1.0 + _NARROW) * ends[0]]
            limit = most_parts - parts if narrow else min(few, most_parts - parts)
            result = family.exclude(
                of, (-most, 0.0), violates, limit, shares=(low, high)
            )
            parts += result.parts
        if result.outcome == "excluded":
            continue
        if result.outcome == "counterexample" or narrow or parts >= most_parts:
            return Exclusion(result.outcome, parts, result.shares)
        waiting += [(0.5 * (low + high), high), (low, 0.5 * (low + high))]
    return Exclusion("excluded", parts)


def _bound(
    family: LoopFamily,
    margin: Margin,
    prove: Callable[[float], Exclusion],
) -> MarginBound:
    start = min(_starts(family), key=margin)
    found, place = _climb(margin, start)
    proven, parts, gap, proofs, raises = 0.0, 0, _GAP, 0, 0
    while found > 0.0 and proofs < _PROOFS and raises < _RAISES:
        result = prove((1.0 - gap) * found)
        parts += result.parts
        if result.outcome == "excluded":
            proven = (1.0 - gap) * found
            break
        if result.shares is not None:
            lower = _climb(margin, result.shares)
            raises += 1
            if lower[0] < found:
                found, place = lower
                continue
        gap *= _WIDER
        proofs += 1
    worst = family.polynomial.point(place)
    return MarginBound(found, proven, worst, math.nan, parts)


def _exact(bound: MarginBound, found: float, omega: float) -> MarginBound:
    """Replaces the margin found by that of the loop itself, without polynomials."""
    return MarginBound(found, bound.proven, bound.worst, omega, bound.parts)


def _starts(family: LoopFamily) -> list[Vector]:
    rng, count = np.random.default_rng(0), len(family.low)
    corners = rng.integers(0, 2, size=(_STARTS, count)).astype(float)
    return [np.full(count, 0.5), *corners, *rng.uniform(size=(_STARTS, count))]


def _worst_corner(margin: Margin, shares: Vector) -> tuple[float, Vector]:
    """Moves one parameter at a time to an end of its interval, as long as it helps."""
    least, place, improved = margin(shares), shares, True
    while improved:
        improved = False
        for k in range(len(shares)):
            for end in (0.0, 1.0):
                trial = place.copy()
                trial[k] = end
                if (value := margin(trial)) < least * (1.0 - 1e-12):
                    least, place, improved = value, trial, True
    return least, place


def _climb(margin: Margin, shares: Vector) -> tuple[float, Vector]:
    """Searches a smaller margin from a point of the box on.

    The search of ``_worst_corner`` is followed by that of Nelder and Mead, unless a
    corner is the worst point near it.
    """
    least, place = _worst_corner(margin, shares)
    if not 0.0 < least < math.inf or _is_worst_near(margin, least, place):
        return least, place
    found = minimize(
        lambda x: margin(np.clip(x, 0.0, 1.0)),
        place,
        method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-11, "maxiter": 80 * len(place)},
    )
    if found.fun < least:
        return float(found.fun), np.clip(found.x, 0.0, 1.0)
    return least, place


def _is_worst_near(margin: Margin, least: float, place: Vector) -> bool:
    """Whether a point is a corner from which the margin grows along each edge."""
    for k, share in enumerate(place):
        if share not in {0.0, 1.0}:
            return False
        inner = place.copy()
        inner[k] += _INWARD if share == 0.0 else -_INWARD
        if margin(inner) <= least:
            return False
    return True
