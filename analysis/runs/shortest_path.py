"""The shortest way of a disc round boxes: what a path length is compared with."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.world.geometry import beyond_each

__all__ = ["shortest_path_length"]

#: Tangents that a quarter circle round a corner is made of: 0.6 % too long.
TANGENTS = 6
#: A way may cut this deep into a rounded box, m: it lies on its outline.
GRAZE_M = 1e-6


def shortest_path_length(
    start: ArrayLike,
    goal: ArrayLike,
    goal_radius: float,
    boxes: ArrayLike,
    radius: float,
) -> float:
    """Length of the shortest way of a disc's centre into a circle round the goal.

    A* over the visibility graph of the boxes, grown by the disc's radius: legs
    run between points of their outlines, the last one straight at the goal.
    The rounded corners are polygons outside the arcs. A box nearer to the start
    than the radius is grown as far as the start allows.

    Args:
        start: (2,) m.
        goal: (2,) m.
        goal_radius: The way ends at this distance from the goal, m.
        boxes: (n, 5) rectangles at rest, see ``systems.world.geometry``.
        radius: Of the disc, m.

    Returns:
        m; 0 from within the circle, infinite where there is no way.
    """
    start, goal = np.asarray(start, dtype=float), np.asarray(goal, dtype=float)
    boxes = np.asarray(boxes, dtype=float).reshape(-1, 5)
    radii = np.minimum(radius, np.array([_distance(start, box) for box in boxes]))
    obstacles = list(zip(boxes, radii - GRAZE_M, strict=True))
    corners = [_outline(box, r) for box, r in zip(boxes, radii, strict=True)]
    points = np.concatenate([start[None], *corners])
    away = goal - points
    distance = np.hypot(away[:, 0], away[:, 1])
    to_goal = np.maximum(distance - goal_radius, 0.0)
    # A goal's disc may hold points; from there the last leg has no length.
    share = to_goal / np.maximum(distance, 1e-12)
    last_leg = _free(points, points + share[:, None] * away, obstacles)
    return _search(points, to_goal, last_leg, obstacles)


def _search(
    points: NDArray[np.float64],
    to_goal: NDArray[np.float64],
    last_leg: NDArray[np.bool_],
    obstacles: list[tuple[NDArray[np.float64], float]],
) -> float:
    """A* from the first point; the straight distance to the goal is its bound."""
    lengths = np.full(len(points), np.inf)
    lengths[0] = 0.0
    best = math.inf
    done = np.zeros(len(points), dtype=bool)
    queue = [(float(to_goal[0]), 0)]
    while queue:
        bound, here = heapq.heappop(queue)
        if bound >= best:
            break
        if done[here]:
            continue
        done[here] = True
        if last_leg[here]:
            best = min(best, float(lengths[here] + to_goal[here]))
        legs = np.hypot(*(points - points[here]).T)
        reach = lengths[here] + legs
        better = np.flatnonzero(~done & (reach < lengths) & (reach + to_goal < best))
        open_way = _free(points[here], points[better], obstacles)
        for there in better[open_way]:
            lengths[there] = reach[there]
            heapq.heappush(queue, (float(reach[there] + to_goal[there]), int(there)))
    return best


def _distance(point: NDArray[np.float64], box: NDArray[np.float64]) -> float:
    outside = beyond_each(_local(point[None], box)[0], box[3:] / 2.0)
    return float(np.hypot(*outside))


def _local(
    points: NDArray[np.float64], box: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 2) points in the box's own axes."""
    c, s = math.cos(box[2]), math.sin(box[2])
    return (points - box[:2]) @ np.array([[c, -s], [s, c]])


def _outline(box: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """(k, 2) corners of a polygon just outside the box grown by the radius."""
    step = 0.5 * math.pi / TANGENTS
    corners = []
    for quarter, (a, b) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = (np.arange(TANGENTS) + 0.5) * step + quarter * 0.5 * math.pi
        arc = radius / math.cos(0.5 * step)
        x = a * box[3] / 2.0 + arc * np.cos(angle)
        y = b * box[4] / 2.0 + arc * np.sin(angle)
        corners.append(np.stack([x, y], axis=1))
    c, s = math.cos(box[2]), math.sin(box[2])
    return np.concatenate(corners) @ np.array([[c, s], [-s, c]]) + box[:2]


def _free(
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    obstacles: list[tuple[NDArray[np.float64], float]],
) -> NDArray[np.bool_]:
    """(n,) whether the legs keep their distances from all boxes."""
    starts = np.broadcast_to(starts, ends.shape)
    free = np.ones(len(ends), dtype=bool)
    for box, radius in obstacles:
        a, b = _local(starts, box), _local(ends, box)
        free &= _distances(a, b, box[3:] / 2.0) >= radius
    return free


def _distances(
    a: NDArray[np.float64], b: NDArray[np.float64], half: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) distance of segments from a box centred on the origin; 0 if they meet."""
    along = b - a
    distance = np.minimum(*(np.hypot(*beyond_each(end, half).T) for end in (a, b)))
    squared = np.maximum(np.sum(along**2, axis=1), 1e-18)
    for corner in half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]):
        t = np.clip(np.sum((corner - a) * along, axis=1) / squared, 0.0, 1.0)
        away = corner - a - t[:, None] * along
        distance = np.minimum(distance, np.hypot(*away.T))
    return np.where(_meet(a, along, half), 0.0, distance)


def _meet(
    a: NDArray[np.float64], along: NDArray[np.float64], half: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(n,) whether segments meet the box: its slabs are crossed at one time."""
    safe = np.where(np.abs(along) < 1e-12, 1e-12, along)
    one, other = (-half - a) / safe, (half - a) / safe
    enter = np.max(np.minimum(one, other), axis=1)
    leave = np.min(np.maximum(one, other), axis=1)
    return (enter <= leave) & (leave >= 0.0) & (enter <= 1.0)
