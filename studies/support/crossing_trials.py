"""Trials of a guarded robot with obstacles that cross near its start."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analysis.safety.driver_trials import (
    DRIVERS,
    DURATION_S,
    Trial,
    make_trial,
    run_result,
)


def draw_crossing(seed: int, number: int, bodies: int, speed: float) -> Trial:
    """Draws a random trial with obstacles that cross near the robot's start.

    Args:
        seed: Seed of all trials.
        number: Number of the trial.
        bodies: Number of moving obstacles, at most six.
        speed: Speed of the moving obstacles, m/s.

    Returns:
        The trial. The same arguments give the same trial.
    """
    draw = np.random.default_rng([seed, number])
    angle = draw.uniform(-math.pi, math.pi, bodies)
    far, goals = draw.uniform(1.5, 3.0, bodies), draw.normal(0.0, 0.7, (bodies, 2))
    boxes = [
        (r * math.cos(a), r * math.sin(a), 0.0, 0.3, 0.3)
        for r, a in zip(far, angle, strict=True)
    ]
    driver = str(draw.choice([*DRIVERS]))
    names = "crossing", driver, "ring of 12"
    rows = DRIVERS[driver](draw, boxes, DURATION_S)
    heading = draw.uniform(-math.pi, math.pi)
    trial = make_trial(names, boxes, rows, heading, (8.0, 0.0), number)
    # The other bodies are far away.
    moving = trial.fields["obstacles"][:bodies]
    for body, goal in zip(moving, goals, strict=True):
        begin = np.array(body["waypoints_m"][0])
        end = begin + 3.5 * (goal - begin) / math.dist(goal, begin)
        body["waypoints_m"] = [tuple(begin.tolist()), tuple(end.tolist())]
        body["speed_m_s"] = speed
    return trial


def contact_speeds(trial: Trial, changes: dict[str, Any]) -> tuple[float, float] | None:
    """Measures how fast a robot moves when it touches something.

    Both speeds are the larger of the values at the last two control periods.

    Args:
        trial: Trial to run.
        changes: Fields of the scenario, as for ``run_trial``.

    Returns:
        Speed of the axle, m/s, and yaw rate, rad/s. None without a contact.
    """
    result = run_result(trial, changes)
    if result.collision is None:
        return None
    columns = {name: values[-2:] for name, values in result.columns.items()}
    speeds = np.hypot(columns["v_WB_x"], columns["v_WB_y"])
    return float(speeds.max()), float(np.abs(columns["omega_WB"]).max())
