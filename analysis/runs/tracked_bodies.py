"""Reconstructs from the log of a run which bodies a robot took as moving."""

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
    """The moving bodies that a robot tracked, at several times.

    The robot has one track per body. A track consists of particles: possible positions
    and velocities of the body.

    All positions are in the frame of the odometry. At the start, this frame equals the
    world frame W. During the run, it drifts away from W.
    """

    times: NDArray[np.float64]
    """(n,) ascending times of ticks (control periods), s."""
    exists: NDArray[np.float64]
    """(n, tracks) probability that the body exists; 0 for an unused track."""
    places: NDArray[np.float64]
    """(n, tracks, 2) mean position of the particles, m; NaN for an unused track."""
    velocities: NDArray[np.float64]
    """(n, tracks, 2) mean velocity of the particles, m/s; NaN for an unused track."""
    spreads: NDArray[np.float64]
    """(n, tracks) standard deviation of the position, m; NaN for an unused track."""


def tracked_bodies(result: RunResult, times: ArrayLike) -> TrackedBodies | None:
    """Reconstructs the moving bodies that a robot tracked at the given times, s.

    For each time, the function uses the nearest tick (control period). A tick that is
    nearest to several times occurs once in the result. The result is None unless the
    law is ``guarded``, which plans around moving bodies. The result is also None if
    ``has_known_space`` is false.
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
    """Returns probability, mean position, mean velocity and spread of each track."""
    exists, particles = hazards.exists.copy(), hazards.particles
    weights = particles.weight[:, :, None]
    motions = np.stack([particles.x, particles.y, particles.vx, particles.vy], axis=2)
    means = np.sum(weights * motions, axis=1)
    off = motions[:, :, :2] - means[:, None, :2]
    spreads = np.sqrt(np.sum(weights * off**2, axis=(1, 2)))
    empty = exists <= 0.0
    means[empty], spreads[empty] = np.nan, np.nan
    return exists, means[:, :2], means[:, 2:], spreads
