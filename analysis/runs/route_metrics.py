"""How a robot on a route kept to its way, and what its gains did."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d
from scipy.spatial import KDTree

from analysis.runs.proximity import Proximity

#: An obstacle is met while the body is nearer to it than this, m: the S of Engelbrecht
#: 2021; and for so long after, s.
MET_M, AFTER_S = 1.0, 5.0
#: What is slower than this is a turn, not a ripple, s.
MEAN_S = 1.0


def route_metrics(proximity: Proximity) -> dict[str, float | None]:
    """Of a robot on a route.

    Args:
        proximity: Of its run.

    Returns:
        Distances of P from its way, m; ripple of the yaw rate, rad/s; how often a way
        was planned anew; and least, greatest and last K and D where they adapt.
    """
    result = proximity.result
    columns, tick_s = result.columns, result.scenario.tick_s
    # The target goes along the way, and at the end is ahead of P.
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
    """When an obstacle is nearer than 1 m, or was within the last 5 s.

    Args:
        clearance: (n,) of the body at even intervals, m.
        period_s: Of these, s.

    Returns:
        (n,).
    """
    near = np.asarray(clearance, dtype=float) < MET_M
    ticks = np.arange(len(near))
    last = np.maximum.accumulate(np.where(near, ticks, -len(near) - 1e9))
    return np.asarray(ticks - last <= AFTER_S / period_s + 1e-9)


def yaw_ripple(
    rate: ArrayLike, where: NDArray[np.bool_], period_s: float
) -> float | None:
    """RMS of a yaw rate less its moving mean over 1 s, rad/s.

    Args:
        rate: (n,) at even intervals, rad/s.
        where: (n,) which of them count.
        period_s: Interval, s.

    Returns:
        None where nothing counts.
    """
    if not np.any(where):
        return None
    rate = np.asarray(rate, dtype=float)
    width = 2 * round(0.5 * MEAN_S / period_s) + 1
    ripple = rate - uniform_filter1d(rate, width, mode="nearest")
    return float(np.sqrt(np.mean(ripple[where] ** 2)))
