"""Computes the metrics of a run. docs/metrics.md defines each metric in words."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.runs.collision_warning import collision_warning
from analysis.runs.proximity import Proximity
from analysis.runs.route_metrics import route_metrics
from analysis.runs.search_metrics import search_metrics
from analysis.runs.shortest_path import shortest_path_length
from analysis.runs.smoothness import (
    jerk,
    log_dimensionless_jerk,
    spectral_arc_length,
    turn_reversals,
    windows,
)
from diagrams.running.run_result import RunResult
from diagrams.running.stop_rules import REST_SPEED_M_S, ROUNDING_S
from systems.framework.compiling import njit
from systems.world.geometry import beyond_rectangle, control_point_velocity

#: Position error above which an estimate is an outlier, m.
OUTLIER_M = 0.5
#: Length of the windows over which the smoothness of the motion is computed, s.
WINDOW_S = 4.0
#: If the robot is always slower than this in a window, the window counts as rest, m/s.
MOVING_M_S = 0.05
#: Least turn rate that counts as turning, rad/s.
TURNING_RAD_S = 0.1
#: Least push that counts as a reaction of the law, N. It accelerates 3.94 kg by
#: 0.13 m/s^2.
REACTION_N = 0.5
#: An echo belongs to an obstacle if its distance differs from the true distance of this
#: obstacle by at most this value, m.
ECHO_M = 0.2


def run_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes all metrics of a run, in SI units.

    If a metric does not apply to the run, its value is None. If the run has several
    robots, each name begins with the name of the robot and a dot.

    Args:
        result: Result of a run, for one robot or several robots.

    Returns:
        Value of each metric, by name.
    """
    if result.several:
        return {
            f"{name}.{metric}": value
            for name, own in result.several.items()
            for metric, value in run_metrics(own).items()
        }
    proximity = Proximity(result)
    if result.scenario.only.searches is not None:
        return search_metrics(proximity)
    return {
        **_proximity_metrics(proximity),
        **_goal_metrics(result),
        **_way_metrics(proximity),
        **_smoothness_metrics(result),
        **_effort_metrics(result),
        **_odometry_metrics(result),
        "reaction_distance_m": _reaction_distance(proximity),
        **collision_warning(result),
        **(_hearing_metrics(result) if "detected" in result.columns else {}),
    }


def following_error(result: RunResult) -> NDArray[np.float64]:
    """(n,) distance from P to the source minus the follow distance, at each tick, m."""
    distance = result.columns["source_range_true"]
    return distance - result.scenario.only.follow_distance_m


def _proximity_metrics(proximity: Proximity) -> dict[str, float | None]:
    """Computes the clearances and the time to contact.

    The source counts as a body, but not as an obstacle.
    """
    least, contact = proximity.least.tolist(), proximity.least_time_to_contact
    others = len(proximity.result.surroundings.obstacles)
    return {
        "minimum_clearance_m": min(least, default=None),
        "minimum_obstacle_clearance_m": min(least[:others], default=None),
        "clearance_p05_m": _quantile(proximity.clearance, 0.05) if least else None,
        "minimum_time_to_contact_s": contact if np.isfinite(contact) else None,
    }


def _goal_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes the metrics of the path to the goal.

    The control point P is in the goal if its distance from the target is at most
    ``goal_radius_m``.
    """
    columns, moves = result.columns, result.target_moves
    inside = columns["source_range_true"] <= result.goal_radius_m
    entries = np.flatnonzero(inside)
    length = float(np.sum(_lengths(np.diff(result.vector("p_WB")))))
    shortest = None if moves else _shortest_path(result)
    return {
        "time_to_goal_s": float(result.time[entries[0]]) if len(entries) else None,
        "settling_time_s": _settling_time(result, inside),
        "path_length_m": length,
        "shortest_path_m": shortest,
        "spl": None if shortest is None else _spl(result.cause, length, shortest),
        "final_distance_m": float(columns["source_range_true"][-1]),
    }


def _settling_time(result: RunResult, inside: NDArray[np.bool_]) -> float | None:
    """Returns the settling time, s.

    After this time, the control point P stays in the goal until the run ends. If the
    source is at rest, P also has to stay at rest.
    """
    stop, settled, least = result.scenario.stop, inside, 0.0
    if not result.target_moves:
        settled = inside & (_speed_of_P(result) < REST_SPEED_M_S)
        least = stop.rest_time_s - ROUNDING_S
    exits = np.flatnonzero(~settled)
    first = int(exits[-1]) + 1 if len(exits) else 0
    if first == len(settled) or result.time[-1] - result.time[first] < least:
        return None
    return float(result.time[first])


def _speed_of_P(result: RunResult) -> NDArray[np.float64]:
    """(n,) speed of the control point P at each tick, m/s."""
    theta, turning = result.columns["theta_WB"], result.columns["omega_WB"]
    velocity = *result.vector("v_WB"), turning
    offset = result.scenario.only.robot.control_point_m
    return _lengths(control_point_velocity(theta, velocity, offset))


def _shortest_path(result: RunResult) -> float | None:
    """Returns the length of the shortest path from the start to the goal, m.

    The path is that of a disc as wide as the robot. It ends at the first point from
    which the control point P can reach into the goal.
    """
    scenario = result.scenario
    around = result.surroundings
    boxes = [b.rectangle(0.0) for b in around.obstacles.values() if not b.path.moves]
    length = shortest_path_length(
        scenario.only.start.position_m,
        around.followed.path.pose(0.0)[:2],
        result.goal_radius_m + scenario.only.robot.control_point_m,
        boxes,
        scenario.only.robot.width_m / 2.0,
    )
    return length if np.isfinite(length) else None


def _spl(cause: str, length: float, shortest: float) -> float:
    """Returns success weighted by path length (SPL) for one run.

    The SPL of Anderson et al. (2018) is the mean of these values over many runs. The
    path length includes all motion until the run ends, such as oscillation in the goal.
    """
    if cause != "reached":
        return 0.0
    longest = max(length, shortest)
    return shortest / longest if longest > 0.0 else 1.0


def _way_metrics(proximity: Proximity) -> dict[str, float | None]:
    """Returns the metrics of following a sound, or the metrics of driving a route."""
    if proximity.result.scenario.only.kind != "router":
        return _following_metrics(proximity.result)
    return route_metrics(proximity)


def _following_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes metrics of how well the robot follows the source.

    The metrics of the following error and of the bearing cover the time after the
    second burst of the source. The metric ``following_fraction`` covers the time after
    the first detection.
    """
    sound, columns = result.scenario.source.sound, result.columns
    settled = result.time >= sound.start_s + sound.period_s + sound.on_s
    errors = np.abs(following_error(result))
    following = errors <= result.scenario.stop.following_band_m
    valid = columns["target_valid"] > 0.5
    since_heard = np.maximum.accumulate(valid)
    error = errors[settled]
    bearing = np.degrees(columns["source_bearing_true"][settled])
    return {
        "following_fraction": _mean(following[since_heard]),
        "following_error_rms_m": _rms(error),
        "following_error_p95_m": _quantile(error, 0.95),
        "following_bearing_rms_deg": _rms(bearing),
        "valid_target_fraction": _mean(valid),
    }


def _smoothness_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes the smoothness of the motion of B's origin, and of the heading."""
    columns, tick_s = result.columns, result.scenario.tick_s
    velocity = result.vector("v_WB")
    linear = _lengths(jerk(velocity.T, tick_s).T)
    angular = jerk(columns["omega_WB"], tick_s)
    speed = _lengths(velocity)
    movements = windows(speed, round(WINDOW_S / tick_s))
    moving = np.max(movements, axis=1, initial=0.0) >= MOVING_M_S
    movements = movements[moving & np.any(np.diff(movements, 2) != 0.0, axis=1)]
    sparc = spectral_arc_length(movements, 1.0 / tick_s)
    ldlj = log_dimensionless_jerk(movements, 1.0 / tick_s)
    path = float(np.sum(speed)) * tick_s
    turned = float(np.sum(np.abs(np.diff(columns["theta_WB"]))))
    reversals = turn_reversals(columns["omega_WB"], TURNING_RAD_S)
    duration = result.simulated_s
    return {
        "jerk_rms_m_s3": _rms(linear),
        "jerk_max_m_s3": float(np.max(linear)) if len(linear) else None,
        "angular_jerk_rms_rad_s3": _rms(angular),
        "sparc": _quantile(sparc, 0.5),
        "ldlj": _quantile(ldlj, 0.5),
        "turn_reversals_per_s": reversals / duration if duration > 0.0 else None,
        "heading_change_rad_m": turned / path if path > MOVING_M_S else None,
        "mean_speed_m_s": float(np.mean(speed)),
        "top_speed_m_s": float(np.max(speed)),
    }


def _effort_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes the effort of the law and of the wheels."""
    columns, robot = result.columns, result.scenario.only.robot
    wheels = np.array([columns[f"wheel_speed_{side}"] for side in ("left", "right")])
    variation = np.mean(np.abs(np.diff(wheels))) if len(result.time) > 1 else 0.0
    pulling = _lengths(result.vector("v_WP"))
    full = 0.999
    saturated = np.max(np.abs(wheels), axis=0) >= full * robot.top_wheel_speed
    saturated |= pulling >= full * robot.top_speed_m_s
    return {
        **_force_metrics(result),
        "wheel_variation_m_s2": float(variation)
        * robot.wheel_radius_m
        / result.scenario.tick_s,
        "saturated_fraction": _mean(saturated),
        "impossible_obstacle_speed_ticks": _impossible_speeds(result),
    }


def _force_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes the effort from the forces of the law, if the law logs its forces."""
    if "repulsion_x" not in result.columns:
        return {"control_effort_rms_n": None, "push_work_j": None}
    repulsion = result.vector("repulsion")
    force = result.vector("attraction") + repulsion
    # The push at a tick changes the velocity of the previous row to that of this row.
    after = result.vector("v_WP")
    before = np.column_stack([np.zeros(2), after[:, :-1]])
    push = np.sum(repulsion * (before + after) / 2.0, axis=0)
    return {
        "control_effort_rms_n": _rms(_lengths(force)),
        "push_work_j": float(np.sum(push)) * result.scenario.tick_s,
    }


def _impossible_speeds(result: RunResult) -> int | None:
    """Counts the ticks (control periods) with an impossible obstacle speed.

    A speed that the control law assumes for an obstacle is impossible if it exceeds
    twice the top speed of the robot.
    """
    columns, top = result.columns, result.scenario.only.robot.top_speed_m_s
    if "obstacle_speed_1" not in columns:
        return None
    speeds = np.array([columns[f"obstacle_speed_{k}"] for k in (1, 2, 3)])
    return int(np.count_nonzero(np.any(speeds > 2.0 * top, axis=0)))


def _odometry_metrics(result: RunResult) -> dict[str, float | None]:
    """Computes the errors of the pose by odometry, and the slip of the wheels."""
    columns = result.columns
    error = _lengths(result.vector("p_WB_estimated") - result.vector("p_WB"))
    turned = columns["theta_WB_estimated"] - columns["theta_WB"]
    slip = None
    if result.scenario.only.plant.friction is not None:
        wheels = np.stack([columns["slip_left"], columns["slip_right"]])
        speeds = _lengths((wheels, columns["slip_sideways"]))
        slip = float(np.sum(np.mean(speeds, axis=0))) * result.scenario.tick_s
    return {
        "odometry_error_rms_m": _rms(error),
        "odometry_error_final_m": float(error[-1]),
        "odometry_heading_error_rms_deg": _rms(np.degrees(turned)),
        "slip_way_m": slip,
    }


def _reaction_distance(proximity: Proximity) -> float | None:
    """Returns the distance from P to the nearest obstacle at the first reaction, m."""
    result, columns = proximity.result, proximity.result.columns
    known = {"repulsion_x", "feature_1"}.issubset(columns)
    if not result.surroundings.obstacles or not known:
        return None
    echoes = [
        [columns[f"feature_{k}"], *result.vector(f"collision_{k}_B")] for k in (1, 2, 3)
    ]
    distance = _first_reaction(
        proximity.bodies,
        result.vector("p_WP"),
        result.vector("repulsion"),
        np.array(echoes),
    )
    return distance if math.isfinite(distance) else None


@njit(cache=True)
def _first_reaction(
    bodies: NDArray[np.float64],
    p_WP: NDArray[np.float64],
    push: NDArray[np.float64],
    echoes: NDArray[np.float64],
) -> float:  # pragma: no cover  (compiled)
    """Returns how near an obstacle is when the control law first reacts to it.

    The law reacts at a tick (control period) if three conditions hold:

    - The repulsive force is at least ``REACTION_N``.
    - The nearest obstacle is nearer to the control point P than the target is.
    - A collision vector agrees with this obstacle: its length differs from the distance
      of the obstacle by at most ``ECHO_M``. A collision vector points from P to an
      echo.

    Args:
        bodies: (m, n, 5) rectangles of the m bodies at n ticks. The last body is the
            target of the robot.
        p_WP: (2, n) positions of P in the world frame W, m.
        push: (2, n) repulsive force of the law in W, N.
        echoes: (k, 3, n) k collision vectors. Each has three entries: a number above 0
            if there is a vector, and its x and y in the robot frame B, m.

    Returns:
        Distance from P to the nearest obstacle, m. It is infinite if the law never
        reacted.
    """
    for i in range(push.shape[1]):
        if math.hypot(push[0, i], push[1, i]) < REACTION_N:
            continue
        nearest, distance = np.inf, np.inf
        for k in range(len(bodies)):
            nearest = min(nearest, distance)
            du, dv = beyond_rectangle(p_WP[:, i], bodies[k, i])
            distance = math.hypot(du, dv)
        if nearest >= distance:
            continue
        for there, x, y in echoes[:, :, i]:
            if there > 0.5 and abs(math.hypot(x, y) - nearest) <= ECHO_M:
                return nearest
    return np.inf


def _hearing_metrics(result: RunResult) -> dict[str, Any]:
    """Counts the audio frames that the robot heard, and computes estimation errors."""
    columns, new = result.columns, _new_frames(result)
    sounding = new & _sounding(result)
    heard = new & (columns["detected"] > 0.5)
    ranged = heard & (columns["range_valid"] > 0.5)
    away = result.vector("p_WS_estimated") - result.vector("p_WS")
    # The target uses an estimate from the next tick on.
    error = _lengths(away[:, 1:][:, ranged[:-1]])
    return {
        "frames_with_sound": int(np.count_nonzero(sounding)),
        "frames_with_sound_heard": int(np.count_nonzero(sounding & heard)),
        "detections": int(np.count_nonzero(heard)),
        "detections_with_range": int(np.count_nonzero(ranged)),
        "source_error_median_m": _quantile(error, 0.5),
        "source_error_p95_m": _quantile(error, 0.95),
        "source_outlier_fraction": _mean(error > OUTLIER_M),
    }


def frames_with_sound(result: RunResult) -> NDArray[np.bool_]:
    """(n,) whether an audio frame with sound ends at each tick (control period).

    A frame has sound if the source sounds during at least half of the frame. Only the
    schedule of the source counts. Therefore a pause within a recording counts as sound.
    The function includes the travel time of the sound, except with ideal hearing.

    Args:
        result: Result of a run, for one robot that hears.

    Returns:
        (n,) whether a frame with sound ends at each tick.
    """
    return _new_frames(result) & _sounding(result)


def _sounding(result: RunResult) -> NDArray[np.bool_]:
    """(n,) whether at least half of the last audio frame has sound, at each tick."""
    scenario, time = result.scenario, result.time
    travel = np.zeros(len(time))
    if scenario.follower.hearing == "audio":
        # The distance is that at the end of the frame, which is half a frame too late.
        travel = result.columns["source_range_true"] / scenario.sound_speed_m_s
    elif scenario.follower.hearing == "ideal_always":
        return np.ones(len(time), dtype=bool)
    middle = 0.5 * scenario.follower.microphones.frame_s
    sounds: NDArray[np.bool_] = scenario.source.sound.sounds(time - middle - travel)
    return sounds


def _new_frames(result: RunResult) -> NDArray[np.bool_]:
    """(n,) whether an audio frame ends at each tick."""
    tick_s = result.scenario.tick_s
    ticks_a_frame = round(result.scenario.follower.microphones.frame_s / tick_s)
    ticks = np.rint(result.time / tick_s).astype(int)
    fresh: NDArray[np.bool_] = (ticks > 0) & (ticks % ticks_a_frame == 0)
    return fresh


def _lengths(vectors: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    """(n,) lengths of vectors. The function ``numpy.hypot`` is three times slower."""
    x, y = vectors
    lengths: NDArray[np.float64] = np.sqrt(x * x + y * y)
    return lengths


def _mean(flags: NDArray[np.bool_]) -> float | None:
    return int(np.count_nonzero(flags)) / len(flags) if len(flags) else None


def _rms(values: NDArray[np.float64]) -> float | None:
    return math.sqrt(values @ values / len(values)) if len(values) else None


def _quantile(values: NDArray[np.float64], q: float) -> float | None:
    """Returns a quantile, interpolated as by ``numpy.quantile``, but much faster."""
    if not len(values):
        return None
    place = q * (len(values) - 1)
    low = int(place)
    high = min(low + 1, len(values) - 1)
    ordered = np.partition(values, (low, high))
    return float(ordered[low] + (place - low) * (ordered[high] - ordered[low]))
