"""Computes the steered response of an array at many positions of a search grid.

The cross-correlation of each pair of microphones measures how well a delay fits. The
response of a position is the mean over the pairs, taken at the delays of sound from
this position (DiBiase 2000). The grid has three kinds of positions:

- directions, for a distant source;
- directions with an inverse range, if the array is large enough to detect curved wave
  fronts;
- points between the microphones of a large array.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter1d

from systems.delays.correlations import correlations_at_lags
from systems.framework.compiling import njit
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

# Half of the largest change of a pair's path difference between two neighbors of the
# grid, as a share of the shortest wavelength.
_PATH_SHARE = 0.1
_WIDEST_STEP_RAD = math.radians(4.0)

# _LARGEST_GRID: largest number of positions times pairs. A response then takes a few
#   milliseconds.
# _OVER_LEAST: if many microphones need a larger grid even with the widest steps, the
#   limit is this multiple of that grid.
# _COARSER: factor by which the grid becomes coarser in each trial.
_LARGEST_GRID = 1_500_000
_OVER_LEAST = 1.5
_COARSER = 1.25

# Least range of grid positions given by a direction and an inverse range, in apertures.
_OUTSIDE = 0.6

# Least range of points between the microphones, as a share of the least range of a
# source. Without these points, a source that is too near would appear to be farther
# away.
_TOO_NEAR = 0.1

# Samples of a correlation per period of the highest frequency.
_LAG_DENSITY = 16.0


@dataclass(frozen=True)
class SearchGrid:
    """Grid of positions, and the delays of sound from each position."""

    p_AS: NDArray[np.float64]
    """(g, d) positions relative to the centroid, m. Unit vectors for distant positions.
    """
    inverse_range: NDArray[np.float64]
    """(g,) inverse range of each position, 1/m; 0 for distant positions."""
    lags: NDArray[np.int32]
    """(g, p) column of each pair's correlation for each position."""
    length: int
    """Number of samples of a correlation that covers a whole window."""
    lag_rate_hz: float
    """Columns of a correlation per second of delay."""
    max_lag: int
    """Number of columns on either side of the column for delay 0."""
    blur: NDArray[np.int64]
    """(p,) width of the maximum filter over each pair's correlation, columns. With the
    filter, a grid that is coarser than the peaks does not miss them."""
    coarseness: float
    """Step of the grid relative to the width of the peaks; 1 if the grid is as fine as
    the peaks."""
    angle_rad: float
    """Largest angle between neighboring directions, rad."""

    @classmethod
    def of(
        cls, shape: ArrayShape, c: float, high_hz: float, window_s: float
    ) -> SearchGrid:
        """Makes a grid with all positions that the array can distinguish.

        If all microphones of a plane array are given by (x, y), the grid also contains
        distant positions above the plane. Their delays are shorter than those of any
        position in the plane. The rate ``lag_rate_hz`` is about ``LAG_DENSITY`` times
        ``high_hz``.
        """
        path = _PATH_SHARE * c / high_hz
        coarseness = 1.0
        least = _OVER_LEAST * _count(shape, math.inf)
        most = max(_LARGEST_GRID / len(shape.pairs), least)
        while _count(shape, coarseness * path) > most:
            coarseness *= _COARSER
        places, inverse = _places(shape, coarseness * path)
        length = int(
            fft.next_fast_len(math.ceil(_LAG_DENSITY * high_hz * window_s), real=True)
        )
        lag_rate_hz = length / window_s
        first, second = shape.pairs.T
        later = centroid_delays(places, inverse, shape, c)
        delays = lag_rate_hz * (later[:, second] - later[:, first])
        max_lag = math.ceil(lag_rate_hz * shape.max_delay(c)) + 1
        missed = (coarseness - 1.0) * path * shape.distances_m / shape.aperture_m
        return cls(
            p_AS=places,
            inverse_range=inverse,
            lags=np.rint(delays).astype(np.int32) + max_lag,
            length=length,
            lag_rate_hz=lag_rate_hz,
            max_lag=max_lag,
            blur=1 + 2 * np.rint(lag_rate_hz * missed / c).astype(np.int64),
            coarseness=coarseness,
            angle_rad=_Steps.of(shape, coarseness * path).angle,
        )

    def correlations(
        self, cross: NDArray[np.complex64], bins: slice, slack: int = 0
    ) -> NDArray[np.float32]:
        """Computes (p, 2 m + 1) correlations from the (p, f) cross-spectra of pairs.

        The delay 0 is in column m, which is ``max_lag`` + ``slack``. The magnitudes of
        each cross-spectrum add up to at most 1, so all values are between -1 and 1.
        """
        m = self.max_lag + slack
        values = correlations_at_lags(cross, bins, self.length, m)
        return values * np.float32(0.5 * self.length)


def centroid_delays(
    places: NDArray[np.float64],
    inverse_range: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
) -> NDArray[np.float64]:
    """Returns how much later sound arrives at each microphone than at the centroid, s.

    The delays have the shape (g, n). The (g, d) places are relative to the centroid, m.
    Distant sources have the inverse range 0, and their places are unit vectors.
    """
    far = -places @ shape.p_AM.T
    if shape.body is not None:
        units = places / np.maximum(np.linalg.norm(places, axis=1), 1e-12)[:, None]
        return far / c + shape.body.later(units)
    ranges = np.linalg.norm(places, axis=1, keepdims=True)
    to_microphones = np.linalg.norm(places[:, np.newaxis] - shape.p_AM, axis=2)
    near = inverse_range[:, np.newaxis] > 0.0
    return np.where(near, to_microphones - ranges, far) / c


@dataclass(frozen=True)
class _Steps:
    """Steps of the grid. The paths of neighbors differ by at most 2 ``path``."""

    angle: float
    levels: NDArray[np.float64]
    """Inverse ranges of the grid except 0, 1/m."""
    lattice: float
    """Step of the lattice of points within the array, m; 0 if there is no lattice."""
    nearest: float
    """Radius of the lattice, m."""

    @classmethod
    def of(cls, shape: ArrayShape, path: float) -> _Steps:
        aperture = shape.aperture_m
        nearest = max(_OUTSIDE * aperture, NEAREST_M)
        # A wave front from the range r differs from a plane by aperture^2 / (8 r).
        step = 16.0 * path / aperture**2
        count = math.ceil(1.0 / (nearest * step) - 0.5)
        return cls(
            angle=min(2.0 * path / aperture, _WIDEST_STEP_RAD),
            levels=step * np.arange(1, count + 1, dtype=np.float64),
            lattice=2.0 * path if nearest > NEAREST_M else 0.0,
            nearest=nearest,
        )


def _count(shape: ArrayShape, path: float) -> float:
    """Returns the approximate number of grid positions, without making them."""
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
    """Returns (2 or 3, d) axes of the searched space. The last axis points ahead."""
    if shape.ahead is None:
        return shape.span
    return np.vstack((shape.span, shape.ahead))


def _directions(dimension: int, step: float, *, ahead: bool) -> NDArray[np.float64]:
    """Returns (g, dimension) unit vectors in all directions, or only those ahead."""
    if dimension == 2:
        angles = step * np.arange(math.ceil(2.0 * math.pi / step))
        unit = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    else:
        # These points along a spiral all represent equal areas of the sphere.
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
    """Returns (g, dimension) points around the centroid, between the microphones."""
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
    """Computes the mean of the pairs' correlations at the delays of each grid position.

    The (p, 2 max_lag + 1) correlations have the rate ``grid.lag_rate_hz``, with delay 0
    in the middle.
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
