"""Maps of places where the robot rests before obstacles, over gap width or box offset.

With exact nearest points, the point mass has an energy and rests at a local minimum of
this energy. A grid search finds smooth minima, and also minima at kinks between two
bodies. With the cones of ultrasonic sensors there is no energy. In this case the
diagram is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from analysis.loops.ideal_scenarios import changed, ideal_scenario
from analysis.loops.point_mass import PointMass, point_mass
from diagrams import Scenario, simulate
from systems.framework.input_error import InputError

#: Size of the boxes along and across the line to the source, as printed, m.
BOX_M = (0.05, 0.1)
#: First: x of the boxes, m. Second: distance from the boxes to the goal, m.
BOX_X_M, TO_GO_M = 2.0, 2.0
#: Spacing of the energy grid, m. First: for gaps. Second: for offsets, where the
#: energy minimum is as narrow as a box.
_GAP_CELL_M, _OFFSET_CELL_M = 0.02, 0.01
#: Follow distance of the maps, m. With the printed value the goal would be inside the
#: leader robot, which repels P too.
_FOLLOW_M = 1.2
#: Fields of the scenario for each way to sense the boxes.
_SENSING: dict[str, dict[str, Any]] = {
    "exact nearest": {"collision_vector": {"aggregation": "nearest"}},
    "exact sum": {"collision_vector": {"aggregation": "sum"}},
    "cones": {"obstacle_sensing": "ultrasonic"},
}


@dataclass(frozen=True)
class RestPoint:
    """Place where P comes to rest."""

    value: float
    """Value of the varied parameter, m."""
    x_m: float
    """x of P in W, m."""
    y_m: float
    """y of P in W, m."""
    outcome: str
    """``goal``, ``jam`` (P is held before the boxes), or ``collision``."""


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Places of rest over one parameter."""

    law: str
    """The scenario's law."""
    parameter: str
    """``gap_m`` or ``offset_m``."""
    sensing: str
    """``exact nearest``, ``exact sum`` or ``cones``."""
    values: tuple[float, ...]
    """Values of the parameter, m."""
    points: tuple[RestPoint, ...]
    """Places of rest, ordered by value. With cones: the end of each run."""

    @property
    def jams(self) -> tuple[float, ...]:
        """Values at which P jams."""
        return self._values("jam")

    @property
    def collisions(self) -> tuple[float, ...]:
        """Values at which the robot hits a box. Only cones can lead to collisions."""
        return self._values("collision")

    def _values(self, outcome: str) -> tuple[float, ...]:
        return tuple(sorted({p.value for p in self.points if p.outcome == outcome}))

    def to_dict(self) -> dict[str, Any]:
        """Values for the JSON document."""
        return vars(self) | {"jams": self.jams, "collisions": self.collisions}


def local_minima(model: PointMass, *, cell_m: float) -> NDArray[np.float64]:
    """Returns the grid cells whose potential is not higher than that of any neighbor.

    The grid can miss a minimum whose basin is narrower than two cells. Where no body
    pushes, the points at the follow distance form one flat minimum. All cells of this
    minimum are returned.

    Args:
        model: Point mass with bodies, source and gains.
        cell_m: Side of the square cells, m.

    Returns:
        (n, 2) positions of the cells in the world frame W, m.
    """
    points = np.concatenate([model.rectangles[:, :2], [model.p_WP]])
    margin = model.follow_distance_m + 0.5
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    x, y = (np.arange(a, b, cell_m) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    flat = grid.reshape(-1, 2)
    potential = np.where(
        model.clearances(flat) > 0.0, model.potential(flat), np.inf
    ).reshape(grid.shape[:2])
    # The border counts as lower than all cells, so that no cell beside it is a minimum.
    least = potential <= minimum_filter(potential, 3, mode="constant", cval=-np.inf)
    return np.asarray(grid[least & np.isfinite(potential)])


def _refined(
    model: PointMass, point: NDArray[np.float64], cell_m: float
) -> tuple[float, float]:
    """Refines a minimum of the potential by compass search.

    The search moves to a lower neighbor, and halves its step if there is none. The
    first step is short, so that the search does not leave a small basin.
    """
    step, here = 0.125 * cell_m, point.copy()
    angle = 2.0 * np.pi * np.arange(16) / 16
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    value = float(model.potential(here[None])[0])
    while step > 1e-4:
        tries = here + step * directions
        values = model.potential(tries)
        best = int(np.argmin(values))
        if values[best] < value:
            here, value = tries[best], float(values[best])
        else:
            step *= 0.5
    return float(here[0]), float(here[1])


def gap_map(
    scenario: Scenario,
    gaps_m: Sequence[float] = tuple(np.round(np.arange(0.2, 2.41, 0.1), 2)),
    *,
    sensing: str = "exact nearest",
) -> EquilibriumMap:
    """Finds the places of rest before two boxes, for several gaps between the boxes.

    The boxes stand on both sides of the line to the source.

    Args:
        scenario: Scenario with law and gains.
        gaps_m: Distances between the facing sides of the boxes, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.

    Returns:
        Places of rest for each gap.

    Raises:
        InputError: The law is not known or has no radial force, or ``sensing`` is
            unknown.
    """

    def boxes(gap: float) -> list[tuple[float, float]]:
        y = 0.5 * (gap + BOX_M[1])
        return [(BOX_X_M, y), (BOX_X_M, -y)]

    return _map(scenario, ("gap_m", gaps_m, boxes, _GAP_CELL_M), sensing)


def offset_map(
    scenario: Scenario,
    offsets_m: Sequence[float] = tuple(np.round(np.arange(0.0, 0.21, 0.02), 2)),
    *,
    sensing: str = "cones",
) -> EquilibriumMap:
    """Finds the places of rest before one box beside the line to the source.

    Args:
        scenario: Scenario with law and gains.
        offsets_m: Distances of the box's center from the line, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.

    Returns:
        Places of rest for each offset.

    Raises:
        InputError: The law is not known or has no radial force, or ``sensing`` is
            unknown.
    """

    def box(offset: float) -> list[tuple[float, float]]:
        return [(BOX_X_M, offset)]

    varied = ("offset_m", offsets_m, box, _OFFSET_CELL_M)
    return _map(scenario, varied, sensing)


def _map(
    scenario: Scenario,
    varied: tuple[
        str, Sequence[float], Callable[[float], list[tuple[float, float]]], float
    ],
    sensing: str,
) -> EquilibriumMap:
    """Map over a parameter: its name, values, boxes by value, and cell size, m."""
    parameter, numbers, boxes, cell_m = varied
    if sensing not in _SENSING:
        words = ", ".join(repr(word) for word in _SENSING)
        raise InputError("sensing", f"{sensing!r} is unknown; use one of {words}")
    values = tuple(float(v) for v in numbers)
    points = []
    for value in values:
        case = boxes_scenario(scenario, boxes(value), sensing)
        found = _end_of_run(case) if sensing == "cones" else _minima(case, cell_m)
        points += [RestPoint(value, x, y, outcome) for x, y, outcome in found]
    return EquilibriumMap(scenario.only.law, parameter, sensing, values, tuple(points))


def _minima(case: Scenario, cell_m: float) -> list[tuple[float, float, str]]:
    """Minima before the boxes, and the lowest minimum behind the boxes."""
    model = point_mass(case)
    minima = local_minima(model, cell_m=cell_m)
    held = minima[:, 0] < BOX_X_M + BOX_M[0]
    jams: list[tuple[float, float]] = []
    for cell in minima[held]:
        place = _refined(model, cell, cell_m)
        # From a shallow minimum, the search may move to the goal or to another jam.
        if place[0] < BOX_X_M + BOX_M[0] and all(
            math.dist(place, other) > cell_m for other in jams
        ):
            jams.append(place)
    beyond = minima[~held]
    goal = beyond[[np.argmin(model.potential(beyond))]] if len(beyond) else beyond
    return [(x, y, "jam") for x, y in jams] + [
        (*_refined(model, cell, cell_m), "goal") for cell in goal
    ]


def _end_of_run(case: Scenario) -> list[tuple[float, float, str]]:
    """Position of P at the end of a run, and the outcome."""
    result = simulate(case, engine="compiled")
    x, y = (float(result.columns[f"p_WP_{axis}"][-1]) for axis in "xy")
    if result.cause == "collision":
        return [(x, y, "collision")]
    return [(x, y, "jam" if x < BOX_X_M + BOX_M[0] else "goal")]


def boxes_scenario(
    scenario: Scenario,
    places: list[tuple[float, float]],
    sensing: str,
    size_m: tuple[float, float] = BOX_M,
) -> Scenario:
    """Returns a scenario with boxes between the start and the source, on the x axis.

    Args:
        scenario: Scenario with law and gains.
        places: Centers of the boxes in the world frame W, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.
        size_m: Size of each box along and across the x axis, m.

    Returns:
        Scenario of 60 s with exact hearing and a start at rest.
    """
    far = BOX_X_M + TO_GO_M + _FOLLOW_M
    boxes = [
        {"name": f"box {k + 1}", "size_m": list(size_m), "waypoints_m": [list(p)]}
        for k, p in enumerate(places)
    ]
    world = {
        "duration_s": 60.0,
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "obstacles": boxes,
        "source": {"waypoints_m": [[far, 0.0]], "heading_deg": 0.0},
        "attraction": {"follow_distance_m": _FOLLOW_M},
    }
    return changed(ideal_scenario(scenario), world | _SENSING[sensing])
