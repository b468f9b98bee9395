"""Delays of a sound at microphones, and their derivatives by the source.

A pair (h, w) describes a source at the position h / w. If w is 1, h is the position. If
h is a unit vector, w is the inverse range, which may be 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.hearing.source_fix import NEAREST_M

# Smallest range of a source that explains delays, as a share of the aperture. The limit
# is at least NEAREST_M, and at most _NEAREST_APERTURE_M, m. Nearer sources would
# explain almost any delays of a few microphones.
_NEAREST_APERTURES, _NEAREST_APERTURE_M = 0.75, 0.75

# Inverse ranges at which a search begins, as shares of the largest inverse range.
_STARTS = (0.0, 0.3, 0.9)

_STEPS = 12

# Damping of a step, as a share of the information about a direction.
_DAMPING = 1e-3


@dataclass(frozen=True)
class WaveFront:
    """Delays relative to channel 0, and their slopes."""

    delays: NDArray[np.float64]
    """(n - 1,) t_k - t_0, s."""
    by_places: NDArray[np.float64]
    """(n - 1, n d) slopes along the microphones' coordinates, s/m."""
    by_speed: NDArray[np.float64]
    """(n - 1,) slopes along the speed of sound, s/(m/s)."""
    by_h: NDArray[np.float64]
    """(n - 1, d) slopes along h."""
    by_w: NDArray[np.float64]
    """(n - 1,) slopes along w."""


def wave_front(
    p: NDArray[np.float64], c: float, h: NDArray[np.float64], w: float
) -> WaveFront:
    """Computes the delays of sound from a source at h / w to (n, d) positions p.

    For a microphone at m, the path from the source is longer than the path to the
    origin by D = (|h - w m| - |h|) / w. The code uses a form of D that allows w = 0.
    """
    count, dimension = p.shape
    to_source = h - w * p
    rho = np.maximum(np.linalg.norm(to_source, axis=1), 1e-12)
    rho_0 = max(float(np.linalg.norm(h)), 1e-12)
    square = np.sum(p**2, axis=1)
    path = (w * square - 2.0 * (p @ h)) / (rho + rho_0)
    by_own = -to_source / rho[:, np.newaxis]
    by_places = np.zeros((count, count, dimension))
    by_places[np.arange(count), np.arange(count)] = by_own
    by_h = -(p + np.outer(path / rho_0, h)) / rho[:, np.newaxis]
    nearer = np.sum(p * to_source, axis=1) / rho
    by_w = (square + path * nearer) / (rho + rho_0)
    later = path[1:] - path[0]
    return WaveFront(
        delays=later / c,
        by_places=(by_places[1:] - by_places[0]).reshape(count - 1, -1) / c,
        by_speed=-later / c**2,
        by_h=(by_h[1:] - by_h[0]) / c,
        by_w=(by_w[1:] - by_w[0]) / c,
    )


def wave_front_misfits(
    lags: NDArray[np.float64], p: NDArray[np.float64], c: float
) -> NDArray[np.float64]:
    """Computes what the best wave fronts leave of measured delays.

    Args:
        lags: (k, n - 1) delays of channels 1 ... n - 1 relative to channel 0, for k
            stretches of sound, s. NaN: not measured.
        p: (n, 2) or (n, 3) positions of the microphones, m.
        c: Speed of sound, m/s.

    Returns:
        (k, n) difference of the arrival at each microphone from that of the wave front
        of the source that fits best, s. The mean of a stretch is 0. NaN: not measured.
    """
    p = np.pad(p - p.mean(axis=0), ((0, 0), (0, 3 - p.shape[1])))
    aperture = float(np.linalg.norm(p[:, np.newaxis] - p, axis=2).max())
    nearest = min(_NEAREST_APERTURES * aperture, _NEAREST_APERTURE_M)
    limit = 1.0 / max(NEAREST_M, nearest)
    paths = c * np.hstack((np.zeros((len(lags), 1)), lags))
    heard = np.isfinite(paths)
    paths = np.where(heard, paths, 0.0)
    first = _plane_waves(_centered(paths, heard), _centered_places(p, heard))
    best = np.full(paths.shape, np.inf)
    for start in _STARTS:
        left = _left_of_fit(paths, heard, p, first, start * limit, limit)
        better = np.sum(left**2, axis=1) < np.sum(best**2, axis=1)
        best[better] = left[better]
    return np.where(heard, best, np.nan) / c


def _centered(
    values: NDArray[np.float64], heard: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Removes the mean of the heard channels of each stretch; others become 0."""
    count = heard.sum(axis=1, keepdims=True)
    mean = np.sum(values * heard, axis=1, keepdims=True) / count
    return np.asarray((values - mean) * heard)


def _centered_places(
    p: NDArray[np.float64], heard: NDArray[np.bool_]
) -> NDArray[np.float64]:
    each = [_centered(np.broadcast_to(x, heard.shape), heard) for x in p.T]
    return np.stack(each, axis=2)


def _plane_waves(
    paths: NDArray[np.float64], p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (k, 3) unit vectors to distant sources that fit centered paths."""
    u = -np.einsum("kan,kn->ka", np.linalg.pinv(p, rcond=1e-2), paths)
    length = np.linalg.norm(u, axis=1, keepdims=True)
    u = u / np.maximum(length, 1.0)
    # The part across a row or a plane follows from the unit length.
    across = np.linalg.svd(p)[2][:, 2]
    rest = 1.0 - np.sum(u**2, axis=1, keepdims=True)
    return np.asarray(u + np.sqrt(np.maximum(rest, 1e-6)) * across)


def _left_of_fit(
    paths: NDArray[np.float64],
    heard: NDArray[np.bool_],
    p: NDArray[np.float64],
    u: NDArray[np.float64],
    start: float,
    limit: float,
) -> NDArray[np.float64]:
    """Returns what a source of an inverse range of at most ``limit`` leaves, m.

    Damped Gauss-Newton steps of all stretches together begin at the directions u.
    """
    w = np.full(len(paths), start)
    square = np.sum(p**2, axis=1)
    best = np.full(paths.shape, np.inf)
    for _ in range(_STEPS + 1):
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        to_source = u[:, np.newaxis] - w[:, np.newaxis, np.newaxis] * p
        rho = np.maximum(np.linalg.norm(to_source, axis=2), 1e-12)
        path = (w[:, np.newaxis] * square - 2.0 * (u @ p.T)) / (rho + 1.0)
        left = _centered(paths - path, heard)
        better = np.sum(left**2, axis=1) < np.sum(best**2, axis=1)
        best[better] = left[better]
        by_u = -(p + path[:, :, np.newaxis] * u[:, np.newaxis]) / rho[:, :, np.newaxis]
        by_u -= np.einsum("kna,ka->kn", by_u, u)[:, :, np.newaxis] * u[:, np.newaxis]
        by_w = (square + path * np.sum(p * to_source, axis=2) / rho) / (rho + 1.0)
        slopes = np.concatenate((by_u, by_w[:, :, np.newaxis]), axis=2)
        slopes = np.stack([_centered(slopes[:, :, k], heard) for k in range(4)], axis=2)
        information = np.einsum("kna,knb->kab", slopes, slopes)
        scale = np.trace(information[:, :3, :3], axis1=1, axis2=2)
        damping = _DAMPING * scale[:, np.newaxis, np.newaxis] * np.eye(4)
        pull = np.einsum("kna,kn->ka", slopes, left)
        step = np.linalg.solve(information + damping, pull[:, :, np.newaxis])[:, :, 0]
        length = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
        u = u + step[:, :3] * np.minimum(1.0, 0.5 / np.maximum(length, 1e-12))
        w = np.clip(w + step[:, 3], 0.0, limit)
    return best
