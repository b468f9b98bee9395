"""Chooses the times, the part of the floor and the title of a picture of a run."""

from __future__ import annotations

import math
import textwrap

import numpy as np
from numpy.typing import NDArray

from diagrams import RunResult, Scenario
from diagrams.running.stop_rules import SUCCESSFUL
from diagrams.scenario.bodies import Path
from diagrams.scenario.participants import Router
from systems.world.plane import rectangle_corners

#: Possible intervals between the times that a picture shows, s. They are round numbers.
_NICE_PERIODS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0)

#: Largest number of characters per line of a title.
LONGEST_LINE = 80


def tick_at(result: RunResult, time: float) -> int:
    """Returns the index of the tick (control period) nearest to a time, s."""
    return int(np.argmin(np.abs(result.time - time)))


def picture_times(result: RunResult, most: int = 10) -> NDArray[np.float64]:
    """Returns times at constant intervals from 0 to the end of the run, s.

    The result has at most ``most`` times. ``most`` must be at least 2.
    """
    end = result.simulated_s
    period = next((p for p in _NICE_PERIODS_S if end / p < most), end / (most - 1))
    return np.arange(0.0, end + 1e-9, period)


def run_title(result: RunResult) -> str:
    """Returns the scenario, the law and the outcome of a run on one line."""
    told = result.several and result.cause not in SUCCESSFUL
    who = f"{result.name} " if told else ""
    scenario = result.full_scenario
    return f"{scenario.name}, law {scenario.law_names}: {who}{result.ending}"


def picture_title(result: RunResult) -> str:
    """Returns the title of a picture: ``run_title`` and the duration of the run.

    After a collision, the title also states whose fault the collision was.
    """
    fault = f" ({result.collision.fault}'s fault)" if result.collision else ""
    title = f"{run_title(result)}{fault} after {result.simulated_s:.1f} s"
    return textwrap.fill(title, LONGEST_LINE)


def bounds(result: RunResult, margin: float) -> tuple[float, float, float, float]:
    """Returns a rectangle that contains the centers of all bodies during the whole run.

    Of walls and polygons, it contains all corners. The rectangle has the least x,
    greatest x, least y and greatest y in the world frame W, m. It extends beyond all
    centers by ``margin``, m. It includes the walls of the room, if there is a room. It
    ignores estimated positions, because a large error would enlarge the picture too
    much.
    """
    centers = [
        own.poses(body)[:, :2]
        for own in result.robots.values()
        for body in ("WB", "WS")
    ]
    times = picture_times(result, most=60)
    return _bounds(result.full_scenario, centers, times, margin)


def expected_bounds(
    scenario: Scenario, margin: float
) -> tuple[float, float, float, float]:
    """Returns a rectangle that contains all bodies of a run before it starts.

    The format is that of ``bounds``. Robots count with their starts and goals, and
    sources and obstacles with their whole paths.
    """
    robots = scenario.robots
    centers = [np.array([each.start.pose[:2]]) for each in robots.values()]
    centers += [
        np.array([each.route.goal_m])
        for each in robots.values()
        if isinstance(each, Router)
    ]
    times = np.linspace(0.0, scenario.duration_s, 240)
    return _bounds(scenario, centers, times, margin)


def _bounds(
    scenario: Scenario,
    centers: list[NDArray[np.float64]],
    times: NDArray[np.float64],
    margin: float,
) -> tuple[float, float, float, float]:
    """Returns a rectangle around points and around the paths of other bodies."""
    paths: list[Path] = [each.path() for each in scenario.sources.values()]
    centers += [path.poses(times)[:, :2] for path in paths]
    for each in scenario.all_obstacles:
        poses, shape = each.path().poses(times), each.shape()
        if shape.centered:
            centers.append(poses[:, :2])
        else:
            rows = shape.at(poses).reshape(-1, 6)
            centers += [rectangle_corners(row) for row in rows]
    points = np.concatenate(centers)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    if scenario.room is not None:
        corner, wall = scenario.room.corner, 0.2
        low = np.minimum(low, corner - wall)
        high = np.maximum(high, corner + scenario.room.size_m[:2] + wall)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def shown_rectangle(result: RunResult) -> tuple[float, float, float, float]:
    """Returns the part of the floor that a replay shows first.

    The format is that of ``bounds``.
    """
    return bounds(result, margin=0.5)


def floor_rectangle(result: RunResult) -> tuple[float, float, float, float]:
    """Returns the edges of the floor of a replay in whole meters.

    The format is that of ``bounds``. The floor contains the whole run. It is at least
    as large as the arena of the scenario.
    """
    return whole_meters(bounds(result, margin=0.8), result.full_scenario.arena_m)


def whole_meters(
    edges: tuple[float, float, float, float], arena_m: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Returns a rectangle in whole meters that contains another one, see ``bounds``.

    It is at least as large as an arena with the given width and depth, m.
    """
    x_low, x_high, y_low, y_high = edges
    width, depth = arena_m
    x_more = max(width - (x_high - x_low), 0.0) / 2.0
    y_more = max(depth - (y_high - y_low), 0.0) / 2.0
    return (
        float(math.floor(x_low - x_more)),
        float(math.ceil(x_high + x_more)),
        float(math.floor(y_low - y_more)),
        float(math.ceil(y_high + y_more)),
    )
