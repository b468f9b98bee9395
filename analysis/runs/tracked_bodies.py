"""Where a guarded robot took bodies to be that move, worked out again from its log."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.runs.known_space import has_known_space, logged_readings, remembered_space
from diagrams import RunResult
from systems.laws.guarded_controller import hazard_sensors
from systems.planning.guarded_drive import SOURCE_RADIUS_M
from systems.planning.hazards import Hazards, make_hazards, track_hazards


@dataclass(frozen=True)
class TrackedBodies:
    """The tracks of a robot at some times.

    The frame is that of the odometry: it is W at the start, and drifts from it.
    """

    times: NDArray[np.float64]
    """(n,) of ticks, ascending, s."""
    exists: NDArray[np.float64]
    """(n, tracks) probability that the body is there; 0 of an empty track."""
    places: NDArray[np.float64]
    """(n, tracks, 2) mean of the particles, m; NaN of an empty track."""
    velocities: NDArray[np.float64]
    """(n, tracks, 2) m/s; likewise."""
    spreads: NDArray[np.float64]
    """(n, tracks) standard deviation of the place, m; likewise."""


def tracked_bodies(result: RunResult, times: ArrayLike) -> TrackedBodies | None:
    """What a robot with the guarded law took to move.

    Args:
        result: The run of one robot.
        times: (n,) at which, s; of each the nearest tick is taken, once.

    Returns:
        Its tracks; None with another law, or where a block of a user's own stands in
        for the sensors or the map.
    """
    scenario, columns = result.scenario, result.columns
    if scenario.only.law != "guarded" or not has_known_space(result):
        return None
    wanted = np.ravel(np.asarray(times, dtype=float))
    rows = np.unique(np.abs(result.time[:, None] - wanted).argmin(axis=0))
    hazards = make_hazards(scenario.follower.ultrasonic.count)
    sensors = hazard_sensors(
        scenario.follower.ultrasonic, scenario.only.robot, scenario.tick_s
    )
    targets = result.vector("p_WS_estimated").T
    targets[columns["target_valid"] < 0.5] = np.inf
    found = []
    readings = logged_readings(result)
    for row, (read, space) in enumerate(
        zip(readings, remembered_space(result), strict=True)
    ):
        ranges, echo, ages, pose, _ = read
        followed = (*targets[row].tolist(), SOURCE_RADIUS_M)
        time = float(result.time[row])
        track_hazards(
            hazards, time, pose, (ranges, echo, ages), space, followed, sensors
        )
        if row in rows:
            found.append(_view(hazards))
        if row == rows[-1]:
            break
    exists, places, velocities, spreads = map(np.array, zip(*found, strict=True))
    return TrackedBodies(result.time[rows], exists, places, velocities, spreads)


def _view(hazards: Hazards) -> tuple[NDArray[np.float64], ...]:
    """Existence, place, velocity and spread of each track."""
    exists, particles = hazards.exists.copy(), hazards.particles
    weights = particles.weight[:, :, None]
    motions = np.stack([particles.x, particles.y, particles.vx, particles.vy], axis=2)
    means = np.sum(weights * motions, axis=1)
    off = motions[:, :, :2] - means[:, None, :2]
    spreads = np.sqrt(np.sum(weights * off**2, axis=(1, 2)))
    empty = exists <= 0.0
    means[empty], spreads[empty] = np.nan, np.nan
    return exists, means[:, :2], means[:, 2:], spreads
