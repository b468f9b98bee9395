"""Figures of merit of a run."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Body, robot_rectangle
from diagrams.simulation import RunResult
from systems.geometry import rectangle_clearance

__all__ = ["clearance", "following_error", "run_metrics"]

#: Below this clearance the time between two ticks is searched, m.
NEAR_M = 0.1
#: Instants looked at between two ticks.
BETWEEN_TICKS = 10
#: A detection is off when it is farther from the source than this, m.
OUTLIER_M = 0.5


def clearance(result: RunResult) -> NDArray[np.float64]:
    """Distance from the robot's rectangle to the nearest body, at each tick.

    Bodies are the obstacles and the master robot.

    Returns:
        (n,) m; negative depth where they overlap.
    """
    bodies, poses = _bodies(result), result.poses("WB")
    ticks = zip(result.time, poses, strict=True)
    return np.array([_clearance_at(result, bodies, t, pose) for t, pose in ticks])


def minimum_clearance(result: RunResult, at_ticks: NDArray[np.float64]) -> float:
    """Smallest clearance, between ticks too, m.

    A tick's clearance says little about a box that passes in 25 ms; where it
    is below ``NEAR_M`` the poses are interpolated to a tenth of a tick.
    """
    bodies, times, poses = _bodies(result), result.time, result.poses("WB")
    least = float(np.min(at_ticks))
    near = np.flatnonzero(np.minimum(at_ticks[:-1], at_ticks[1:]) < NEAR_M)
    for k in near:
        for part in np.arange(1, BETWEEN_TICKS) / BETWEEN_TICKS:
            time = times[k] + part * (times[k + 1] - times[k])
            pose = poses[k] + part * (poses[k + 1] - poses[k])
            least = min(least, _clearance_at(result, bodies, time, pose))
    return least


def following_error(result: RunResult) -> NDArray[np.float64]:
    """Distance of P from the source, less the follow distance, (n,) m."""
    distance = result.columns["source_range_true"]
    return distance - result.scenario.attraction.follow_distance_m


def run_metrics(result: RunResult) -> dict[str, float | None]:
    """All metrics of a run, SI units; None where one does not apply.

    ``following_*`` counts from the end of the second burst on. The bearing
    and position errors are those of frames with a detection.
    """
    scenario, columns, time = result.scenario, result.columns, result.time
    speed = np.hypot(columns["v_WB_x"], columns["v_WB_y"])
    steps = np.hypot(np.diff(columns["p_WB_x"]), np.diff(columns["p_WB_y"]))
    error = following_error(result)
    sound = scenario.sound
    settled = time >= sound.start_s + sound.period_s + sound.on_s
    followed = np.abs(error[settled])
    reached = np.flatnonzero(columns["source_range_true"] <= scenario.goal_radius_m)
    speeds = np.stack([columns[f"obstacle_speed_{k}"] for k in (1, 2, 3)])
    impossible = np.any(speeds > 2.0 * scenario.robot.top_speed_m_s, axis=0)
    return {
        "minimum_clearance_m": minimum_clearance(result, clearance(result)),
        "path_length_m": float(np.sum(steps)),
        "time_to_goal_s": float(time[reached[0]]) if len(reached) else None,
        "following_fraction": _mean(followed <= scenario.stop.following_band_m),
        "following_error_rms_m": _rms(followed),
        "following_error_p95_m": _quantile(followed, 0.95),
        "final_distance_m": float(columns["source_range_true"][-1]),
        "mean_speed_m_s": float(np.mean(speed)),
        "top_speed_m_s": float(np.max(speed)),
        "impossible_obstacle_speed_ticks": int(np.count_nonzero(impossible)),
        "valid_target_fraction": float(np.mean(columns["target_valid"] > 0.5)),
        **_hearing_metrics(result),
    }


def _hearing_metrics(result: RunResult) -> dict[str, Any]:
    """How good the fresh estimates were."""
    columns = result.columns
    heard = columns["detected"] > 0.5
    ranged = heard & (columns["range_valid"] > 0.5)
    error = np.hypot(
        columns["p_WS_estimated_x"] - columns["p_WS_x"],
        columns["p_WS_estimated_y"] - columns["p_WS_y"],
    )
    off = error[ranged] > OUTLIER_M
    return {
        "detections": int(np.count_nonzero(heard)),
        "detections_with_range": int(np.count_nonzero(ranged)),
        "source_error_median_m": _quantile(error[ranged], 0.5),
        "source_error_p95_m": _quantile(error[ranged], 0.95),
        "source_outlier_fraction": _mean(off),
    }


def _bodies(result: RunResult) -> list[Body]:
    return list(result.scenario.bodies().values())


def _clearance_at(
    result: RunResult, bodies: list[Body], time: float, pose: NDArray[np.float64]
) -> float:
    footprint = robot_rectangle(pose, result.scenario.robot)
    return min(rectangle_clearance(footprint, body.rectangle(time)) for body in bodies)


def _mean(flags: NDArray[np.bool_]) -> float | None:
    return float(np.mean(flags)) if len(flags) else None


def _rms(values: NDArray[np.float64]) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _quantile(values: NDArray[np.float64], q: float) -> float | None:
    return float(np.quantile(values, q)) if len(values) else None
