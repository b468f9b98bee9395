"""Delays of a sound at microphones, and their derivatives by the source.

A pair (h, w) describes a source at the position h / w. If w is 1, h is the position. If
h is a unit vector, w is the inverse range, which may be 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
