"""Grouping of the hits of single beams into surfaces of objects."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit
from systems.ranging.collision_vector import foot_on_segment

# Columns of the row of a group of hits. Outer hits are the first and the last hit.
# ``NEAR``: vector from P to the nearest point of the group, m.
# ``MIDDLE``: vector from P to the middle between the outer hits, m.
# ``EXTENT``: distance between the outer hits, m.
# ``CHORD``: spacing of the beams at the nearest point, m.
# ``OPEN``: 1 if the surface may continue beyond an outer hit, otherwise 0.
NEAR_X, NEAR_Y, MIDDLE_X, MIDDLE_Y, EXTENT, CHORD, OPEN = range(7)
GROUP_SIZE = 7

# Adjacent hits belong to one surface if their distance is below the sum of two terms.
# ``_GAP_M``: first term, m.
# ``_STRETCH``: second term as a multiple of the spacing of the beams. The factor is
#   that of an oblique surface, whose normal is turned from the beam by 60 deg.
_GAP_M, _STRETCH = 0.2, 1.0 / math.cos(math.radians(60.0))
#: Rise of the distance from P that separates two objects, m. A surface is split at a
#: maximum of its distance from P if the maximum exceeds the minima on both sides by
#: more than this rise.
_DIP_M = 0.08


class BeamNumbers(NamedTuple):
    """Directions and range of the beams."""

    apart_rad: NDArray[np.float64]
    """(n,) angle between each beam and its right neighbor, rad; 0 if there is no right
    neighbor."""
    maximum_ranges_m: NDArray[np.float64]
    """(n,) largest range of each beam, m. Surfaces farther away give no echo."""


@njit(cache=True)
def _goes_on(
    hits: Any, ranges: Any, heard: Any, k: int, beams: BeamNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Checks whether beam ``k`` and its right neighbor hit the same surface."""
    other = (k + 1) % len(ranges)
    apart = beams.apart_rad[k]
    if apart == 0.0 or heard[k] < 0.5 or heard[other] < 0.5:
        return False
    chord = 2.0 * min(ranges[k], ranges[other]) * math.sin(0.5 * apart)
    far = math.hypot(hits[other, 0] - hits[k, 0], hits[other, 1] - hits[k, 1])
    return far < _GAP_M + _STRETCH * chord


@njit(cache=True)
def _is_open(
    ranges: Any, heard: Any, own: int, other: int, apart: float, beams: BeamNumbers
) -> bool:  # pragma: no cover  (compiled)
    """Returns whether a surface may continue beyond its outer hit.

    The outer hit is the hit of the beam ``own``. The next beam outward is ``other``.
    ``apart`` is the angle between the two beams, rad, or 0 if there is no next beam.
    There are four cases:

    - If there is no next beam, the surface may continue.
    - If the next beam has a nearer hit, a nearer object may hide the surface, so the
      surface may continue.
    - If the next beam has a farther hit, the surface ends.
    - If the next beam has no echo, the surface may continue only if it would be out of
      the range of this beam.
    """
    if apart == 0.0:
        return True
    if heard[other] < 0.5:
        # A flat face perpendicular to the own beam would be out of range there.
        return bool(ranges[own] > beams.maximum_ranges_m[other] * math.cos(apart))
    return bool(ranges[other] < ranges[own])


@njit(cache=True)
def _describe(
    row: Any, hits: Any, ranges: Any, heard: Any, ends: Any, beams: BeamNumbers
) -> None:  # pragma: no cover  (compiled)
    """Fills the row of one group of hits.

    The nearest point of the group is on a line segment between two adjacent hits.
    ``ends`` has the indices of the first and the last beam of the group. Indices wrap
    around at the number of beams.
    """
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
    """Groups the hits of the beams into objects.

    The function visits the beams from left to right. Adjacent hits belong to one
    surface if they are close enough. A hollow surface, for example the two walls of a
    corner, approaches the control point P twice. One nearest point would not describe
    both sides of such a surface. Therefore the function splits the surface where it is
    farthest from P. The beam at the split belongs to both objects.

    Args:
        hits: (n, 2) vectors (x, y) from P to the hits, m, from left to right.
        ranges: (n,) ranges of the beams, m.
        heard: (n,) 1 if the beam has an echo, otherwise 0.
        beams: Directions and ranges of the beams.

    Returns:
        Two values: (n, GROUP_SIZE) array with one row per group, and the number of
        groups. Rows after the last group are zero.
    """
    count = len(ranges)
    rows, used = np.zeros((count, GROUP_SIZE)), 0
    far = np.hypot(hits[:, 0], hits[:, 1])
    # Start after the first gap. A closed ring without a gap starts at its farthest hit.
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
        # Split at the top, when the distance has risen by more than the dip and has
        # fallen by more than the dip again.
        low = min(low, far[now])
        if far[now] > max(low + _DIP_M, high):
            high, top = far[now], k
        elif high > 0.0 and far[now] < high - _DIP_M:
            _describe(rows[used], hits, ranges, heard, (first, top), beams)
            used += 1
            first, low, high, top = top, far[now], -1.0, k
        ends = k == begin + count - 1
        if ends or not _goes_on(hits, ranges, heard, now, beams):
            _describe(rows[used], hits, ranges, heard, (first, k), beams)
            used += 1
            first = -1
    return rows, used
