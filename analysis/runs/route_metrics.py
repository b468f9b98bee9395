"""Computes metrics of a robot on a route: deviation, yaw ripple and adapted gains."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial import KDTree

from analysis.runs.proximity import Proximity

#: Limits of an encounter with an obstacle. ``MET_M``: greatest clearance during the
#: encounter, m (the distance S of Engelbrecht 2021). ``AFTER_S``: time after the
#: encounter that still counts, s.
MET_M, AFTER_S = 1.0, 5.0
#: Length of the moving mean of the yaw rate, s. Slower changes count as turns, not as
#: ripple.
MEAN_S = 1.0


def route_metrics(proximity: Proximity) -> dict[str, float | None]:
    """Computes the metrics of a robot that drives along a route.

    The metrics are:

    - median and maximum distance of the control point P from the path of the target, m
    - ripple of the yaw rate, rad/s
    - number of new routes
    - least, greatest and last value of stiffness K (N/m) and damping D (N s/m), if the
      control law adapts K and D

    Args:
        proximity: Distances between the robot and all bodies in the run.

    Returns:
        Value of each metric, by name.
    """
    result = proximity.result
    columns, tick_s = result.columns, result.scenario.tick_s
    # The target moves along the route. At the end of the run, it is ahead of P.
    off = KDTree(result.vector("target").T).query(result.vector("p_WP").T)[0]
    met = np.zeros(len(result.time), dtype=bool)
    if len(proximity.bodies):
        met = near_and_after(proximity.clearance, tick_s)
    gains: dict[str, float | None] = {}
    for name, unit in (("stiffness", "n_m"), ("damping", "n_s_m")):
        if name in columns:
            values = columns[name]
            gains |= {
                f"least_{name}_{unit}": float(np.min(values)),
                f"greatest_{name}_{unit}": float(np.max(values)),
                f"last_{name}_{unit}": float(values[-1]),
            }
    return {
        "route_deviation_m": float(np.median(off)),
        "route_deviation_max_m": float(np.max(off)),
        "yaw_ripple_rad_s": yaw_ripple(columns["omega_WB"], met, tick_s),
        "replans": float(columns["replans"][-1]),
        **gains,
    }


def near_and_after(clearance: ArrayLike, period_s: float) -> NDArray[np.bool_]:
    """Returns when an obstacle is nearer than 1 m, or was nearer within the last 5 s.

    Args:
        clearance: (n,) clearance from the nearest obstacle at constant intervals, m.
        period_s: Interval, s.

    Returns:
        (n,) whether one of these conditions holds, for each sample.
    """
    near = np.asarray(clearance, dtype=float) < MET_M
    ticks = np.arange(len(near))
    last = np.maximum.accumulate(np.where(near, ticks, -len(near) - 1e9))
    return np.asarray(ticks - last <= AFTER_S / period_s + 1e-9)


def yaw_ripple(
    rate: ArrayLike, where: NDArray[np.bool_], period_s: float
) -> float | None:
    """Computes the RMS value of a yaw rate minus its moving mean over 1 s.

    Args:
        rate: (n,) yaw rates at constant intervals, rad/s.
        where: (n,) whether each sample counts.
        period_s: Interval, s.

    Returns:
        RMS value, rad/s. The value is None if no sample counts.
    """
    if not np.any(where):
        return None
    rate = np.asarray(rate, dtype=float)
    width = 2 * round(0.5 * MEAN_S / period_s) + 1
    ripple = rate - uniform_filter1d(rate, width, mode="nearest")
    return float(np.sqrt(np.mean(ripple[where] ** 2)))
