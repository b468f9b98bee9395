"""Where the steered response of an array is greatest, over all places.

Each pair of microphones says by its cross-correlation how well a delay fits.
The response of a place is the mean of that over the pairs, at the delays that
sound from there would have (DiBiase 2000). Places are directions for a source
far away, directions with an inverse range where the array is large enough to
see that wave fronts are curved, and points within a large array.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from systems.framework.compiling import njit
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

# Between two neighbours of the grid a pair's path changes by less than twice
# this share of the shortest wavelength.
_PATH_SHARE = 0.1
_WIDEST_STEP_RAD = math.radians(4.0)

# Places times pairs, at most: a few milliseconds a response. Where many microphones
# need more even with the widest steps, it may be so many times what those need.
_LARGEST_GRID = 1_500_000
_OVER_LEAST = 1.5
_COARSER = 1.25

# Sources are sought from this many apertures on by direction and inverse range.
_OUTSIDE = 0.6

# Amid a large array places are sought down to this share of that, so that a
# source which is too near is not taken for one farther off.
_TOO_NEAR = 0.1

#: Samples of a correlation for a period of the highest frequency.
LAG_DENSITY = 16.0


@dataclass(frozen=True)
class SearchGrid:
    """Places, and the delays that sound from there would have."""

    p_AS: NDArray[np.float64]
    """(g, d) places from the centroid, m; unit vectors for those far away."""
    inverse_range: NDArray[np.float64]
    """(g,) 1/m; 0 for the places far away."""
    lags: NDArray[np.int32]
    """(g, p) columns of the correlations, one for each pair."""
    lag_rate_hz: float
    """Columns of a correlation in a second."""
    max_lag: int
    """Columns on either side of no delay."""
    blur: NDArray[np.int64]
    """(p,) columns over which the correlations' greatest value is taken, so
    that a grid coarser than the peaks does not miss them."""
    coarseness: float
    """How much coarser the grid is than the peaks; 1: as fine as they are."""

    @classmethod
    def of(
        cls, shape: ArrayShape, c: float, high_hz: float, lag_rate_hz: float
    ) -> SearchGrid:
        """Covers every place that the array can tell apart.

        A plane array with positions in its plane is searched above the plane,
        too, far away: a source there has shorter delays than any in the plane.

        Args:
            shape: The microphones.
            c: Speed of sound, m/s.
            high_hz: Highest frequency of the correlations, Hz.
            lag_rate_hz: Columns of a correlation in a second, about
                ``LAG_DENSITY`` times as many.

        Returns:
            The g places, and the column of each pair's correlation for each of them.
        """
        path = _PATH_SHARE * c / high_hz
        coarseness = 1.0
        least = _OVER_LEAST * _count(shape, math.inf)
        most = max(_LARGEST_GRID / len(shape.pairs), least)
        while _count(shape, coarseness * path) > most:
            coarseness *= _COARSER
        places, inverse = _places(shape, coarseness * path)
        first, second = shape.pairs.T
        later = centroid_delays(places, inverse, shape, c)
        delays = lag_rate_hz * (later[:, second] - later[:, first])
        max_lag = math.ceil(lag_rate_hz * shape.max_delay(c)) + 1
        missed = (coarseness - 1.0) * path * shape.distances_m / shape.aperture_m
        return cls(
            p_AS=places,
            inverse_range=inverse,
            lags=np.rint(delays).astype(np.int32) + max_lag,
            lag_rate_hz=lag_rate_hz,
            max_lag=max_lag,
            blur=1 + 2 * np.rint(lag_rate_hz * missed / c).astype(np.int64),
            coarseness=coarseness,
        )


def centroid_delays(
    places: NDArray[np.float64],
    inverse_range: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
) -> NDArray[np.float64]:
    """How much later than their centroid the microphones hear each place.

    Args:
        places: (g, d) places in A, m; unit vectors where they are infinitely far.
        inverse_range: (g,) 1/m; 0 where they are infinitely far.
        shape: The n microphones.
        c: Speed of sound, m/s.

    Returns:
        (g, n) s; negative: earlier.
    """
    far = -places @ shape.p_AM.T
    ranges = np.linalg.norm(places, axis=1, keepdims=True)
    to_microphones = np.linalg.norm(places[:, np.newaxis] - shape.p_AM, axis=2)
    near = inverse_range[:, np.newaxis] > 0.0
    return np.where(near, to_microphones - ranges, far) / c


@dataclass(frozen=True)
class _Steps:
    """Steps of the grid between whose neighbours paths differ by 2 ``path``."""

    angle: float
    levels: NDArray[np.float64]
    """Inverse ranges beside 0."""
    lattice: float
    """Step of the lattice within the array; 0: there is none."""
    nearest: float
    """Radius of that lattice, m."""

    @classmethod
    def of(cls, shape: ArrayShape, path: float) -> _Steps:
        aperture = shape.aperture_m
        nearest = max(_OUTSIDE * aperture, NEAREST_M)
        # A wave front from a range r is off the plane by aperture^2 / (8 r).
        step = 16.0 * path / aperture**2
        count = math.ceil(1.0 / (nearest * step) - 0.5)
        return cls(
            angle=min(2.0 * path / aperture, _WIDEST_STEP_RAD),
            levels=step * np.arange(1, count + 1, dtype=np.float64),
            lattice=2.0 * path if nearest > NEAREST_M else 0.0,
            nearest=nearest,
        )


def _count(shape: ArrayShape, path: float) -> float:
    """About how many places there are."""
    steps = _Steps.of(shape, path)
    flat = len(_basis(shape)) == 2
    directions = 2.0 * math.pi / steps.angle if flat else 4.0 * math.pi / steps.angle**2
    directions *= 1.0 + len(steps.levels)
    if steps.lattice:
        ratio = steps.nearest / steps.lattice
        directions += math.pi * ratio**2 if flat else 4.0 / 3.0 * math.pi * ratio**3
    count = directions if shape.ahead is None else 0.5 * directions
    if _is_flat_plane(shape):
        count += 2.0 * math.pi / steps.angle**2
    return count


def _places(
    shape: ArrayShape, path: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places and inverse ranges."""
    steps = _Steps.of(shape, path)
    basis = _basis(shape)
    ahead = shape.ahead is not None
    directions = _directions(len(basis), steps.angle, ahead=ahead) @ basis
    places = [directions] + [directions / level for level in steps.levels]
    inverse = [np.zeros(len(directions))]
    inverse += [np.full(len(directions), level) for level in steps.levels]
    if steps.lattice:
        within = _lattice(len(basis), steps, ahead=ahead) @ basis
        places.append(within)
        inverse.append(1.0 / np.linalg.norm(within, axis=1))
    if _is_flat_plane(shape):
        above = _directions(3, steps.angle, ahead=True)[:, :2]
        places.append(above)
        inverse.append(np.zeros(len(above)))
    return np.concatenate(places), np.concatenate(inverse)


def _is_flat_plane(shape: ArrayShape) -> bool:
    return shape.dimension == 2 and shape.kind == "plane"


def _basis(shape: ArrayShape) -> NDArray[np.float64]:
    """(2 or 3, d) axes of the sought places; the last one points ahead."""
    if shape.ahead is None:
        return shape.span
    return np.vstack((shape.span, shape.ahead))


def _directions(dimension: int, step: float, *, ahead: bool) -> NDArray[np.float64]:
    """(g, dimension) unit vectors; ahead: those with a positive last part."""
    if dimension == 2:
        angles = step * np.arange(math.ceil(2.0 * math.pi / step))
        unit = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    else:
        # Points of equal areas along a spiral.
        count = math.ceil(4.0 * math.pi / step**2)
        height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
        angles = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
        level = np.sqrt(1.0 - height**2)
        unit = np.stack((level * np.cos(angles), level * np.sin(angles), height), 1)
    if ahead:
        unit = unit[unit[:, -1] >= -0.5 * step]
        unit[:, -1] = np.abs(unit[:, -1])
    return unit


def _lattice(dimension: int, steps: _Steps, *, ahead: bool) -> NDArray[np.float64]:
    """(g, dimension) points about the centroid, between the microphones."""
    line = np.arange(-steps.nearest, steps.nearest, steps.lattice) + steps.lattice / 2.0
    axes = [line] * dimension
    if ahead:
        axes[-1] = line[line > 0.0]
    points = np.stack([a.ravel() for a in np.meshgrid(*axes)], axis=1)
    distance = np.linalg.norm(points, axis=1)
    least = _TOO_NEAR * NEAREST_M
    return points[(distance < steps.nearest) & (distance >= least)]


def steered_response(
    correlations: NDArray[np.float32], grid: SearchGrid
) -> NDArray[np.float32]:
    """Mean over the pairs of the correlations at each place's delays.

    Args:
        correlations: (p, 2 max_lag + 1) at the rate of the grid; no delay
            stands in the middle.
        grid: The places.

    Returns:
        (g,) in the unit of the correlations.
    """
    if grid.coarseness > 1.0:
        correlations = np.stack(
            [
                maximum_filter1d(row, size)
                for row, size in zip(correlations, grid.blur, strict=True)
            ]
        )
    return _steer(correlations, grid.lags)


@njit(cache=True)
def _steer(
    correlations: NDArray[np.float32], lags: NDArray[np.int32]
) -> NDArray[np.float32]:  # pragma: no cover  (compiled)
    places, pairs = lags.shape
    out = np.empty(places, dtype=np.float32)
    for g in range(places):
        total = np.float32(0.0)
        for p in range(pairs):
            total += correlations[p, lags[g, p]]
        out[g] = total / np.float32(pairs)
    return out
