"""Gathers the votes for a source that is nearly above or below the array.

There, small errors of the horizontal components of a direction change its azimuth by
any angle, and a histogram of azimuths would split one source into several. The votes
are therefore gathered in the plane of the horizontal components.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# _STEEP_LEVEL: largest horizontal component of a direction that is nearly overhead, at
#   an elevation of 70 deg.
# _LEAST_SHARE: least share of the weight of these votes in that of all votes. Fewer
#   come from reflections at ceiling and floor.
_STEEP_LEVEL, _LEAST_SHARE = 0.35, 0.2

# _REACH: largest horizontal distance of a vote from the source.
# _LARGEST_LEVEL: largest horizontal component of the source, at 60 deg. A source with a
#   larger one is left to the histogram of azimuths.
_REACH, _LARGEST_LEVEL = 0.3, 0.5
_STEPS = 5

# Standard deviation of a bearing of which nothing is known, rad.
_ANY_STD_RAD = math.pi / math.sqrt(3.0)


class SteepVotes(NamedTuple):
    """Votes for one source that is nearly above or below the array."""

    chosen: NDArray[np.bool_]
    """(k,) whether each vote is for this source."""
    dropped: NDArray[np.bool_]
    """(k,) whether the azimuth of each vote has no meaning."""
    bearing: float
    """Bearing of the source, rad."""
    bearing_spread: float
    """Standard deviation of the bearing of one vote, rad."""
    elevation: float
    """Elevation of the source, rad."""


def steep_votes(
    azimuth: NDArray[np.float64],
    elevation: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> SteepVotes | None:
    """Finds the votes for a source that is nearly above or below the array.

    Returns None if there is no such source. The votes with steep elevations are then of
    no use, because their azimuths have no meaning.
    """
    level = np.cos(elevation)
    steep = level < _STEEP_LEVEL
    above = float(weight[steep & (elevation > 0.0)].sum())
    side = 1.0 if 2.0 * above >= float(weight[steep].sum()) else -1.0
    same = side * elevation > 0.0
    if not weight[steep & same].sum() >= _LEAST_SHARE * weight.sum() > 0.0:
        return None
    across = level * np.exp(1j * azimuth)
    chosen = steep & same
    for _ in range(_STEPS):
        center = complex(np.average(across[chosen], weights=weight[chosen]))
        nearer = same & (np.abs(across - center) < _REACH)
        if not nearer.any():
            return None
        chosen = nearer
    if abs(center) > _LARGEST_LEVEL:
        return None
    # The scatter across the direction of the source turns its bearing.
    turned = (across[chosen] - center) * np.exp(-1j * np.angle(center))
    spread = math.sqrt(float(np.average(turned.imag**2, weights=weight[chosen])))
    return SteepVotes(
        chosen,
        chosen | steep,
        float(np.angle(center)),
        min(_ANY_STD_RAD, spread / max(abs(center), 1e-9)),
        side * math.acos(min(1.0, abs(center))),
    )


def without_steep(elevation: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Returns the votes whose azimuths have a meaning."""
    return ~(np.cos(elevation) < _STEEP_LEVEL)
