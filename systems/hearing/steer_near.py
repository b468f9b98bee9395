"""Estimates a bearing from the sums of correlations for positions around an array."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.delays.correlations import parabola_vertex

#: Ranges of the grid, m: a near range and a far range. More ranges would find more
#: echoes.
_RANGES_M = (0.4, 3.0)
#: Step of the bearings of the grid, deg. The peak is refined between them.
_STEP_DEG = 2.0
#: Least difference between the bearings of the strongest peak and of another direction,
#: deg. Nearer peaks do not count as another direction.
_APART_DEG = 15.0


class NearGrid(NamedTuple):
    """Positions around an array, and the delays of sound from there."""

    bearings: NDArray[np.float64]
    """(b,) bearings from the reference microphone, CCW from x, rad."""
    delays: NDArray[np.float64]
    """(pairs, r, b) delays t_j - t_i of each pair (i, j) for each of r ranges and b
    bearings, s."""


class Steered(NamedTuple):
    """The strongest position of a grid."""

    bearing: float
    """Bearing of the strongest position, rad."""
    delays: NDArray[np.float64]
    """(pairs,) delays of the strongest position, s."""
    other: float
    """Bearing of the strongest other peak, rad."""
    other_share: float
    """Ratio of the response at the strongest other peak to the strongest response. It
    is 0 if there is no other peak."""
    response: float
    """Response of the strongest position: the sum of the correlations there."""


def near_grid(
    p_RM: NDArray[np.float64], pairs: list[tuple[int, int]], c: float
) -> NearGrid:
    """Makes the grid of positions around an array.

    Args:
        p_RM: (n, 2) positions of the microphones relative to the reference microphone,
            m.
        pairs: Pairs of microphones.
        c: Speed of sound, m/s.

    Returns:
        The grid, with the delays of sound from its positions.
    """
    bearings = np.radians(np.arange(-180.0, 180.0, _STEP_DEG))
    unit = np.stack([np.cos(bearings), np.sin(bearings)])
    places = np.multiply.outer(np.array(_RANGES_M), unit)  # (r, 2, b)
    ways = np.linalg.norm(places[None] - p_RM[:, None, :, None], axis=2)
    first, second = np.array(pairs).T
    return NearGrid(bearings, (ways[second] - ways[first]) / c)


def _wrapped(angle: Any) -> Any:
    """Returns an angle within [-pi, pi)."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def steer(
    grid: NearGrid, correlations: NDArray[np.float64], fine_rate_hz: float
) -> Steered:
    """Finds the position of a grid with the largest sum of correlations (the response).

    Args:
        grid: Positions, and delays of sound from there.
        correlations: (pairs, n) correlations over the delay. Delay 0 is first, and
            negative delays are at the end.
        fine_rate_hz: Correlation values per second, Hz.

    Returns:
        The position with the strongest response, and the strongest other peak. A
        parabola through the responses at adjacent bearings of the grid refines the
        bearing of the strongest position.
    """
    response = np.zeros(grid.delays.shape[1:])
    length = correlations.shape[1]
    for pair, delays in zip(correlations, grid.delays, strict=True):
        at = delays * fine_rate_hz
        low = np.floor(at).astype(int)
        part = at - low
        response += (1.0 - part) * pair[low % length] + part * pair[(low + 1) % length]
    best = response.max(axis=0)
    k = int(best.argmax())
    row = int(response[:, k].argmax())
    here = best[k]
    shift = parabola_vertex(best[k - 1], here, best[(k + 1) % len(best)])
    bearing = grid.bearings[k] + shift * np.radians(_STEP_DEG)
    off = np.abs(_wrapped(grid.bearings - grid.bearings[k]))
    peak = (best >= np.roll(best, 1)) & (best >= np.roll(best, -1))
    elsewhere = np.where(peak & (off > np.radians(_APART_DEG)), best, -np.inf)
    other = int(elsewhere.argmax())
    share = max(float(elsewhere[other]), 0.0) / here if here > 0.0 else 1.0
    return Steered(
        float(_wrapped(bearing)),
        grid.delays[:, row, k],
        float(grid.bearings[other]),
        share,
        float(here),
    )
