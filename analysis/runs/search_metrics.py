"""Computes the metrics of a robot that searches a source step by step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.runs.proximity import Proximity

#: Sum of the arm lengths of two robots, m: of the listening robot and of the calling
#: robot (Song 2011, 2.1, 3.1). At a smaller distance, the arms can touch.
ARMS_M = 0.15 + 0.20
#: Least speed that counts as driving, m/s.
_DRIVING_M_S = 0.02


def search_metrics(proximity: Proximity) -> dict[str, float | None]:
    """Computes the metrics of one robot that searched, in SI units.

    Args:
        proximity: Distances between the robot and all bodies in the run.

    Returns:
        Value of each metric, by name. docs/metrics.md defines the metrics. If a metric
        does not apply to the run, its value is None.
    """
    result = proximity.result
    columns, time = result.columns, result.time
    over = np.flatnonzero(columns["search_ended"] > 0.5)
    last = int(over[0]) if len(over) else len(time) - 1
    way = result.vector("p_WB")[:, : last + 1]
    length = float(np.sum(np.hypot(*np.diff(way))))
    pose_WS = result.poses("WS")
    apart = np.hypot(*(result.vector("p_WB") - pose_WS[:, :2].T))
    listens = columns.get("listening", np.zeros(1)) > 1.5
    begin = int(listens.argmax())
    straight = float(apart[begin] - apart[last])
    steps = float(columns["search_steps"][last])
    least = proximity.least.tolist()
    others = len(result.surroundings.obstacles)
    return {
        "minimum_clearance_m": min(least, default=None),
        "minimum_obstacle_clearance_m": min(least[:others], default=None),
        "search_steps": steps,
        "search_time_s": float(time[last] - time[begin]),
        "step_length_m": length / steps if steps else None,
        "path_length_m": length,
        "path_efficiency": straight / length if length > 0.0 else None,
        "final_distance_m": float(apart[last]),
        "minimum_distance_m": float(np.min(apart[: last + 1])),
        "driving_fraction": _driving(result.vector("v_WB")[:, : last + 1]),
    }


def _driving(velocity: NDArray[np.float64]) -> float | None:
    speed = np.hypot(*velocity)
    return float(np.mean(speed > _DRIVING_M_S)) if speed.size else None
