"""Places a source anywhere, also among the microphones, from delays with known errors.

Distant recorders have sources among them and around them. Several places may then fit
the delays, for example above and below recorders at nearly equal heights. This module
finds all of them, and averages over the places by their likelihood. The stated errors
therefore cover all places that fit.

The search uses the coordinates y = p / (1 + |p| / a), where p is the place relative to
the centroid, and a is the aperture of the array. Near the array, y equals p. The sphere
|y| = a is infinitely far away. Delays are nearly linear in y at all distances. Before
the delays are known, all y are equally likely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.array_geometry import KnownArray
from analysis.arrays.source_placement import PlacedSource, chi_square_limit
from systems.hearing.multilateration import whitening_matrix
from systems.hearing.source_fix import RANGED, UNCERTAIN, SourceFix

# _STARTS: number of places from which the search begins.
# _STEPS: number of damped Gauss-Newton steps.
# _FARTHEST: largest |y| as a share of the aperture. The range is then 200 apertures.
_STARTS, _STEPS, _FARTHEST = 300, 25, 0.995

# Places whose chi-square exceeds the least one by more than this are unlikely. At most
# _MOST_PLACES are used. Places within _SAME standard deviations are one place.
_UNLIKELY, _MOST_PLACES, _SAME = 30.0, 8, 0.5

# Numbers of draws and of rounds for the averages. The draws of a round follow the
# averages of the round before. They have heavier tails than normally distributed
# errors, with _TAIL degrees of freedom.
_DRAWS, _ROUNDS, _TAIL = 3000, 4, 5.0

# Largest distance of the microphones from their plane or line, in standard deviations
# of the positions, at which the array cannot distinguish the two sides.
_LEVEL = 3.0

# Standard deviation of the height of a source, as a share of the aperture, if the
# positions of the microphones are given by (x, y).
_HEIGHT = 0.25


@dataclass(frozen=True)
class _Problem:
    """Delays, and the (n, q) microphones in the q coordinates of the search, m."""

    tau: NDArray[np.float64]
    p: NDArray[np.float64]
    aperture: float
    c: float
    half: bool
    """Whether the last coordinate of the source is positive."""
    height_std: float
    """Standard deviation of the last coordinate, m; infinite if nothing is known."""

    def places(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        size = np.linalg.norm(y, axis=-1, keepdims=True)
        return np.asarray(y / (1.0 - size / self.aperture))

    def kept(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (k, q) coordinates moved into the searched space."""
        size = np.linalg.norm(y, axis=1, keepdims=True)
        y = y * np.minimum(1.0, _FARTHEST * self.aperture / np.maximum(size, 1e-12))
        if self.half:
            y[:, -1] = np.abs(y[:, -1])
        return y

    def residuals(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the (k, n - 1) measured minus expected delays of k places, s."""
        p = self.places(y)
        # The distances are differences of large numbers for places far away.
        square = np.sum(self.p**2, axis=1) - 2.0 * p @ self.p.T
        ranges = np.linalg.norm(p, axis=1, keepdims=True)
        own = np.sqrt(np.maximum(ranges**2 + square, 0.0))
        longer = square / np.maximum(own + ranges, 1e-12)
        return np.asarray(self.tau - (longer[:, 1:] - longer[:, :1]) / self.c)

    def slopes(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the (k, n - 1, q) derivatives of the expected delays."""
        step = 1e-5 * self.aperture
        out = np.empty((len(y), len(self.tau), y.shape[1]))
        for axis in range(y.shape[1]):
            move = np.zeros(y.shape[1])
            move[axis] = step
            ahead, behind = self.residuals(y + move), self.residuals(y - move)
            out[:, :, axis] = (behind - ahead) / (2.0 * step)
        return out

    def cost(
        self, y: NDArray[np.float64], root: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Returns (k,) chi-squares, with the prior of the height."""
        height = self.places(y)[:, -1] / self.height_std
        return np.asarray(np.sum((self.residuals(y) @ root.T) ** 2, axis=1) + height**2)


def place_call(delays: AlignedDelays, array: KnownArray) -> PlacedSource | None:
    """Estimates the place of a source, averaged over all places that fit its delays.

    A range is given if its standard deviation is at most the share
    ``largest_range_error`` of the range, or of half the aperture if that is longer. The
    result is None if no place fits the delays.
    """
    shape = array.shape
    problem, axes = _problem(delays, array)
    allowed = _errors(np.zeros(shape.dimension), array)
    for _ in range(2):
        whole = delays.covariance + allowed
        root = whitening_matrix(whole)
        modes, costs = _modes(problem, root)
        best = problem.places(modes[:1])[0] @ axes
        allowed = _errors(best[: shape.dimension], array)
    freedom = shape.count - 1 - problem.p.shape[1]
    if costs[0] > chi_square_limit(freedom):
        return None
    y, weights = _draws(problem, root, modes)
    p = problem.places(y) @ axes
    share = float(np.trace(np.linalg.solve(whole, allowed))) / len(whole)
    fix = _averaged(p, weights, float(costs[0]), array)
    scale = math.sqrt(min(share, 1.0))
    systematic = replace(
        fix,
        bearing_std=scale * fix.bearing_std,
        elevation_std=None if fix.elevation_std is None else scale * fix.elevation_std,
        range_std=scale * fix.range_std,
        covariance=scale**2 * fix.covariance,
    )
    return PlacedSource(fix, systematic)


def _problem(
    delays: AlignedDelays, array: KnownArray
) -> tuple[_Problem, NDArray[np.float64]]:
    """Returns the problem, and the (q, 2 or 3) axes of its coordinates."""
    shape = array.shape
    height_std = math.inf
    p, axes = shape.p_AM, np.eye(shape.dimension)
    half = shape.ahead is not None
    if shape.ahead is not None:
        axes = np.vstack((shape.span, shape.ahead))
        # Recorders on slightly different levels distinguish the two sides.
        off = float(np.abs(p @ shape.ahead).max())
        half = shape.side is not None or off < _LEVEL * array.budget.position_std
    elif shape.dimension == 2:
        # The source may be above the plane of the microphones.
        p, axes, half = np.pad(p, ((0, 0), (0, 1))), np.eye(3), True
        height_std = _HEIGHT * shape.aperture_m
    problem = _Problem(
        delays.tau, p @ axes.T, shape.aperture_m, array.c, half, height_std
    )
    return problem, axes


def _errors(p: NDArray[np.float64], array: KnownArray) -> NDArray[np.float64]:
    """Returns the covariance of the delays from a place due to errors of the array."""
    r = float(np.linalg.norm(p))
    u = p / r if r > 0.0 else np.eye(p.size)[0]
    w = 1.0 / max(r, 1e-3)
    return array.budget.delay_covariance(u, w, array.shape, array.c)


def _modes(
    problem: _Problem, root: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (k, q) places that fit the delays best, and their chi-squares."""
    rng = np.random.default_rng(0)
    q = problem.p.shape[1]
    y = rng.standard_normal((_STARTS, q))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    y *= problem.aperture * rng.random((_STARTS, 1)) ** (1.0 / q)
    y = problem.kept(y)
    cost = problem.cost(y, root)
    damping = np.full(_STARTS, 1e-2)
    for _ in range(_STEPS):
        normal, pull = _normal(problem, y, root)
        diagonal = np.einsum("kii->ki", normal)
        diagonal += damping[:, np.newaxis] * diagonal + 1e-12 / problem.aperture**2
        step = np.linalg.solve(normal, pull[..., np.newaxis])[..., 0]
        moved = problem.kept(y + step)
        value = problem.cost(moved, root)
        better = value <= cost
        y[better], cost[better] = moved[better], value[better]
        damping = np.where(better, 0.2 * damping, np.minimum(10.0 * damping, 1e6))
    order = np.argsort(cost)
    normal, _ = _normal(problem, y, root)
    chosen: list[int] = []
    for k in order:
        if cost[k] > cost[order[0]] + _UNLIKELY or len(chosen) == _MOST_PLACES:
            break
        off = y[chosen] - y[k]
        apart = np.einsum("ki,kij,kj->k", off, normal[chosen], off)
        if np.all(apart > _SAME**2):
            chosen.append(int(k))
    return y[chosen], cost[chosen]


def _normal(
    problem: _Problem, y: NDArray[np.float64], root: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (k, q, q) normal matrices and (k, q) right-hand sides."""
    sides = root @ problem.slopes(y)
    residual = problem.residuals(y) @ root.T
    normal = np.einsum("kmi,kmj->kij", sides, sides)
    pull = np.einsum("kmi,km->ki", sides, residual)
    if math.isfinite(problem.height_std):
        stretch = 1.0 / (1.0 - np.linalg.norm(y, axis=1) / problem.aperture)
        info = (stretch / problem.height_std) ** 2
        normal[:, -1, -1] += info
        pull[:, -1] -= info * y[:, -1]
    return normal, pull


def _draws(
    problem: _Problem, root: NDArray[np.float64], modes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (k, q) likely places, and the (k,) weights of their averages.

    The places are drawn around the modes. The weights are the likelihoods divided by
    the density of the draws.
    """
    rng = np.random.default_rng(1)
    q = modes.shape[1]
    normal, _ = _normal(problem, modes, root)
    # A place that the delays do not determine in some direction stays near the array.
    normal += np.eye(q) / (0.5 * problem.aperture) ** 2
    spread = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    centers, share = modes.copy(), np.full(len(modes), 1.0 / len(modes))
    for _ in range(_ROUNDS):
        of = rng.choice(len(centers), _DRAWS, p=share)
        factor = np.linalg.cholesky(spread)
        normals = rng.standard_normal((_DRAWS, q))
        heavy = np.sqrt(rng.chisquare(_TAIL, _DRAWS) / _TAIL)[:, np.newaxis]
        y = centers[of] + np.einsum("kij,kj->ki", factor[of], normals / heavy)
        inside = np.linalg.norm(y, axis=1) < _FARTHEST * problem.aperture
        if problem.half:
            inside &= y[:, -1] > 0.0
        density = np.zeros(_DRAWS)
        for center, inverse, part, f in zip(
            centers, np.linalg.inv(spread), share, factor, strict=True
        ):
            off = y - center
            square = np.einsum("ki,ij,kj->k", off, inverse, off)
            volume = float(np.prod(np.diag(f)))
            density += part / volume * (1.0 + square / _TAIL) ** (-0.5 * (_TAIL + q))
        cost = np.full(_DRAWS, np.inf)
        cost[inside] = problem.cost(y[inside], root)
        weights = np.exp(-0.5 * (cost - cost.min())) / density
        weights /= weights.sum()
        centers, spread, share = _adapted(y, weights, of, (centers, spread))
    used = weights > 0.0
    return y[used], weights[used]


def _adapted(
    y: NDArray[np.float64],
    weights: NDArray[np.float64],
    of: NDArray[np.int64],
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Moves the center and the spread of each group of draws to its averages."""
    centers, spread = before[0].copy(), before[1].copy()
    share = np.full(len(centers), 0.02)
    for k in range(len(centers)):
        own = weights * (of == k)
        total = float(own.sum())
        share[k] += total
        # A few draws do not determine a spread.
        if total**2 > 4.0 * y.shape[1] * float(np.sum(own**2)):
            centers[k] = own @ y / total
            off = y - centers[k]
            spread[k] = (own[:, np.newaxis] * off).T @ off / total
            spread[k] += 1e-9 * np.trace(spread[k]) * np.eye(y.shape[1])
    return centers, spread, share / share.sum()


def _averaged(
    p: NDArray[np.float64],
    weights: NDArray[np.float64],
    chi_square: float,
    array: KnownArray,
) -> SourceFix:
    """Averages (k, d) places relative to the centroid by their (k,) weights."""
    shape = array.shape
    ranges = np.linalg.norm(p, axis=1)
    range_m = float(weights @ ranges)
    range_std = math.sqrt(float(weights @ (ranges - range_m) ** 2))
    bearing, bearing_std = _mean_angle(np.arctan2(p[:, 1], p[:, 0]), weights)
    elevation = elevation_std = None
    if p.shape[1] == 3 and shape.dimension == 3 and shape.angles != ("bearing",):
        heights = np.arctan2(p[:, 2], np.hypot(p[:, 0], p[:, 1]))
        elevation, elevation_std = _mean_angle(heights, weights)
        elevation_std = elevation_std if "elevation" in shape.angles else math.inf
    if "bearing" not in shape.angles:
        bearing_std = math.inf
    scale = max(range_m, 0.5 * shape.aperture_m)
    told = range_std <= array.largest_range_error * scale
    p = p[:, : shape.dimension]
    if not told:
        p = p / np.linalg.norm(p, axis=1, keepdims=True)
    mean = weights @ p
    off = p - mean
    return SourceFix(
        bearing=bearing,
        bearing_std=bearing_std,
        elevation=elevation,
        elevation_std=elevation_std,
        range=range_m if told else 0.0,
        range_status=RANGED if told else UNCERTAIN,
        range_std=range_std if told else math.inf,
        p_AS=mean if told else mean / max(float(np.linalg.norm(mean)), 1e-12),
        covariance=(weights[:, np.newaxis] * off).T @ off,
        chi_square=chi_square,
    )


def _mean_angle(
    angles: NDArray[np.float64], weights: NDArray[np.float64]
) -> tuple[float, float]:
    """Returns the mean of angles and its standard deviation, rad."""
    mean = float(np.angle(weights @ np.exp(1j * angles)))
    off = np.angle(np.exp(1j * (angles - mean)))
    center = mean + float(weights @ off)
    off = np.angle(np.exp(1j * (angles - center)))
    wrapped = math.atan2(math.sin(center), math.cos(center))
    return wrapped, math.sqrt(float(weights @ off**2))
