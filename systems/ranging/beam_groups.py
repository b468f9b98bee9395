"""From the hits of single beams to the surfaces that they lie on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.ranging.collision_vector import foot_on_segment

#: Numbers of a group: vectors from P to its nearest point and to the middle between its
#: outer hits, m; how far these are apart, m; how far beams are apart there, m; and
#: whether it may go on beyond one of them.
NEAR_X, NEAR_Y, MIDDLE_X, MIDDLE_Y, EXTENT, CHORD, OPEN = range(7)
GROUP_SIZE = 7


class BeamNumbers(NamedTuple):
    """What is known of the beams."""

    apart_rad: NDArray[np.float64]
    """(n,) angle of each beam to its right neighbour; 0: it has none."""
    maximum_range_m: float
    gap_m: float
    """Hits of neighbours are on one surface if they are nearer than this and"""
    stretch: float
    """so many times the distance of the beams there."""
    dip_m: float
    """Between two objects the distance from P is larger by this than at each, m."""


@njit(cache=True)
def _goes_on(
    hits: Any, ranges: Any, heard: Any, k: int, beams: BeamNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Whether beam k and its right neighbour hit one surface."""
    other = (k + 1) % len(ranges)
    apart = beams.apart_rad[k]
    if apart == 0.0 or heard[k] < 0.5 or heard[other] < 0.5:
        return False
    chord = 2.0 * min(ranges[k], ranges[other]) * math.sin(0.5 * apart)
    far = math.hypot(hits[other, 0] - hits[k, 0], hits[other, 1] - hits[k, 1])
    return far < beams.gap_m + beams.stretch * chord


@njit(cache=True)
def _is_open(
    ranges: Any, heard: Any, own: int, other: int, apart: float, beams: BeamNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Whether a surface may go on from an outer hit towards the beam beside it."""
    if apart == 0.0:
        return True
    if heard[other] < 0.5:
        # A flat face would be out of range there.
        return ranges[own] > beams.maximum_range_m * math.cos(apart)
    return bool(ranges[other] < ranges[own])


@njit(cache=True)
def _describe(
    row: Any, hits: Any, ranges: Any, heard: Any, ends: Any, beams: BeamNumbers
) -> None:  # pragma: no cover  (compiled)
    """Fills a row of a group from its first to its last beam, counted on in a ring."""
    count = len(ranges)
    first, last = ends[0] % count, ends[1] % count
    nearest = hits[first, 0], hits[first, 1]
    for k in range(ends[0], ends[1]):
        a, b = k % count, (k + 1) % count
        foot = foot_on_segment((hits[a, 0], hits[a, 1]), (hits[b, 0], hits[b, 1]))
        if foot[0] ** 2 + foot[1] ** 2 < nearest[0] ** 2 + nearest[1] ** 2:
            nearest = foot[0], foot[1]
    row[NEAR_X], row[NEAR_Y] = nearest
    row[MIDDLE_X] = 0.5 * (hits[first, 0] + hits[last, 0])
    row[MIDDLE_Y] = 0.5 * (hits[first, 1] + hits[last, 1])
    dx, dy = hits[last, 0] - hits[first, 0], hits[last, 1] - hits[first, 1]
    row[EXTENT] = math.hypot(dx, dy)
    left, right = beams.apart_rad[(first - 1) % count], beams.apart_rad[last]
    row[CHORD] = max(left, right) * math.hypot(nearest[0], nearest[1])
    opens = _is_open(ranges, heard, first, (first - 1) % count, left, beams)
    opens = opens or _is_open(ranges, heard, last, (last + 1) % count, right, beams)
    row[OPEN] = 1.0 if opens else 0.0


@njit(cache=True)
def group_beams(
    hits: Any, ranges: Any, heard: Any, beams: BeamNumbers
) -> tuple[NDArray[np.float64], int]:  # pragma: no cover  (compiled)
    """Objects that beams have hit: surfaces without a hollow.

    Neighbouring hits are on one surface if they are near enough. A surface that comes
    nearer to P twice, as the two walls of a corner, is two objects: of a hollow one the
    nearest point alone would say nothing of its other side.

    Args:
        hits: (n, 2) from P, m, left to right.
        ranges: (n,) of the beams, m.
        heard: (n,) 1 where there was an echo, else 0.
        beams: What is known of the beams.

    Returns:
        (n, GROUP_SIZE) groups, and how many there are.
    """
    count = len(ranges)
    rows, used = np.zeros((count, GROUP_SIZE)), 0
    far = np.hypot(hits[:, 0], hits[:, 1])
    # A ring begins behind a gap, or at its farthest hit.
    begin = int(np.argmax(far * heard))
    for k in range(count):
        if not _goes_on(hits, ranges, heard, k, beams):
            begin = (k + 1) % count
            break
    first, low, high, top = -1, 0.0, 0.0, 0
    for k in range(begin, begin + count):
        now = k % count
        if heard[now] < 0.5:
            continue
        if first < 0:
            first, low, high, top = k, far[now], -1.0, k
        # Up from the least distance by more than a dip, and down again: another one.
        low = min(low, far[now])
        if far[now] > max(low + beams.dip_m, high):
            high, top = far[now], k
        elif high > 0.0 and far[now] < high - beams.dip_m:
            _describe(rows[used], hits, ranges, heard, (first, top), beams)
            used += 1
            first, low, high, top = top, far[now], -1.0, k
        ends = k == begin + count - 1
        if ends or not _goes_on(hits, ranges, heard, now, beams):
            _describe(rows[used], hits, ranges, heard, (first, k), beams)
            used += 1
            first = -1
    return rows, used
