"""What the robot's cones knew of a body that it then touched."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from diagrams.simulation import RunResult
from systems.geometry import cone_range

__all__ = ["Sightings", "sightings"]

#: An echo is a body's if the range that was read is so near to that body's, m.
SAME_M = 0.03


@dataclass(frozen=True)
class Sightings:
    """How a collision came about, as far as the sensors are concerned."""

    warning_s: float | None
    """From the first echo of the body to the contact, s; none: never heard of."""
    unseen_s: float | None
    """From its last echo to the contact, s."""
    push_n: float
    """Push of the law at the last tick, N, whatever it was that pushed."""


def sightings(result: RunResult) -> Sightings | None:
    """Echoes of the body that was hit; none without a collision or cones."""
    hit, columns = result.collision, result.columns
    if hit is None or "range_1" not in columns:
        return None
    known = np.flatnonzero(_echoes(result, hit.object))
    first = result.time[known[0]] if len(known) else None
    last = result.time[known[-1]] if len(known) else None
    push = math.hypot(columns["repulsion_x"][-1], columns["repulsion_y"][-1])
    return Sightings(
        warning_s=None if first is None else float(max(hit.time - first, 0.0)),
        unseen_s=None if last is None else float(max(hit.time - last, 0.0)),
        push_n=push,
    )


def _echoes(result: RunResult, name: str) -> NDArray[np.bool_]:
    """(n,) whether any cone's echo was that body's, at the ticks."""
    scenario, columns = result.scenario, result.columns
    sensors = scenario.ultrasonic
    theta = columns["theta_WB"]
    body = scenario.bodies()[name].rectangles(result.time)
    known = np.zeros(len(result.time), dtype=bool)
    for k, ((x, y), axis_deg) in enumerate(
        zip(sensors.positions_m, sensors.axes_deg, strict=True)
    ):
        c, s = np.cos(theta), np.sin(theta)
        ranges = _cone_ranges(
            columns["p_WP_x"] + c * x - s * y,
            columns["p_WP_y"] + s * x + c * y,
            theta + math.radians(axis_deg),
            math.radians(sensors.beam_half_angle_deg),
            body,
        )
        echo = columns[f"echo_{k + 1}"] > 0.5
        known |= echo & (np.abs(columns[f"range_{k + 1}"] - ranges) <= SAME_M)
    return known


@njit(cache=True)
def _cone_ranges(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    axis: NDArray[np.float64],
    half_angle: float,
    body: NDArray[np.float64],
) -> NDArray[np.float64]:  # pragma: no cover  (compiled)
    """(n,) range of one body in one cone at each tick, m."""
    ranges = np.empty(len(x))
    for i in range(len(x)):
        ranges[i] = cone_range(x[i], y[i], axis[i], half_angle, body[i : i + 1])
    return ranges
