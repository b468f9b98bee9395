"""Compiled computation of poses on a path through waypoints."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit


@njit(cache=True)
def poses_on(
    pieces: NDArray[np.float64], elapsed: NDArray[np.float64]
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """Computes the poses on a path at many times.

    Args:
        pieces: (m, 8) pieces of the path. The columns are those of ``Piece`` in
            ``systems/world/path_pieces.py``.
        elapsed: (n,) times since the start of the first piece, s.

    Returns:
        (n, 3) poses in the world frame W, m and rad.
    """
    poses = np.empty((elapsed.size, 3))
    begins = np.ascontiguousarray(pieces[:, 0])
    cosines, sines = np.cos(pieces[:, 3]), np.sin(pieces[:, 3])
    for i in range(elapsed.size):
        k = np.searchsorted(begins, elapsed[i], side="right") - 1
        begin, x, y, theta, forward, curvature, speed, acceleration = pieces[k]
        since = elapsed[i] - begin
        chord = (speed + 0.5 * acceleration * since) * since
        half = 0.5 * curvature * chord
        c, s = cosines[k], sines[k]
        if half != 0.0:
            # Replace the arc length by the chord, which points along the mean heading.
            chord *= forward * math.sin(half) / half
            c, s = math.cos(theta + half), math.sin(theta + half)
        poses[i, 0] = x + chord * c
        poses[i, 1] = y + chord * s
        poses[i, 2] = theta + 2.0 * half
    return poses
