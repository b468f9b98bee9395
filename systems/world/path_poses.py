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
        pieces: (m, 7) pieces of the path. The columns are start time, s; x and y at the
            start, m; theta at the start, rad; curvature, 1/m; speed at the start, m/s;
            and acceleration, m/s^2.
        elapsed: (n,) times since the start of the first piece, s.

    Returns:
        (n, 3) poses in the world frame W, m and rad.
    """
    poses = np.empty((elapsed.size, 3))
    begins = np.ascontiguousarray(pieces[:, 0])
    cosines, sines = np.cos(pieces[:, 3]), np.sin(pieces[:, 3])
    for i in range(elapsed.size):
        k = np.searchsorted(begins, elapsed[i], side="right") - 1
        begin, x, y, theta, curvature, speed, acceleration = pieces[k]
        since = elapsed[i] - begin
        chord = (speed + 0.5 * acceleration * since) * since
        half = 0.5 * curvature * chord
        c, s = cosines[k], sines[k]
        if half != 0.0:
            # Replace the arc length by the chord, which points along the mean heading.
            chord *= math.sin(half) / half
            c, s = math.cos(theta + half), math.sin(theta + half)
        poses[i, 0] = x + chord * c
        poses[i, 1] = y + chord * s
        poses[i, 2] = theta + 2.0 * half
    return poses
