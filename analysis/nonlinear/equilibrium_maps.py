"""Where the laws jam: rest points over gap width, obstacle offset, k_ref/K_0.

With exact nearest points the point mass has an energy, and it rests where that
is least: local minima on a grid, which finds kinks between two bodies as well
as smooth ones. With cones there is no energy; there the diagram itself is run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from analysis.models.ideal_scenarios import changed, ideal_scenario
from analysis.models.point_mass import PointMass, point_mass
from diagrams import Scenario, simulate
from systems.framework.input_error import InputError

#: Footprint of the boxes, m: along and across the line to the source; printed.
BOX_M = (0.05, 0.1)
#: Place of the boxes, and what is left to go behind them, m.
BOX_X_M, TO_GO_M = 2.0, 2.0
#: Spacing of the grid on which energies are compared, m: of gaps, and of offsets,
#: where what holds P is as narrow as a box.
_GAP_CELL_M, _OFFSET_CELL_M = 0.02, 0.01
#: Follow distance of the maps, m: as printed the attraction would end in the
#: master robot, which repels as well.
_FOLLOW_M = 1.2
#: Ways to sense the boxes, as fields of a scenario.
_SENSING: dict[str, dict[str, Any]] = {
    "exact nearest": {"collision_vector": {"aggregation": "nearest"}},
    "exact sum": {"collision_vector": {"aggregation": "sum"}},
    "cones": {"obstacle_sensing": "ultrasonic"},
}


@dataclass(frozen=True)
class RestPoint:
    """A place where P comes to rest."""

    value: float
    """The parameter that is varied."""
    x_m: float
    """m."""
    y_m: float
    """m."""
    outcome: str
    """``goal``, ``jam`` (held before the boxes), or ``collision``."""


@dataclass(frozen=True, eq=False)
class EquilibriumMap:
    """Rest points over one parameter."""

    law: str
    """The scenario's law."""
    parameter: str
    """``gap_m`` or ``offset_m``."""
    sensing: str
    """``exact nearest``, ``exact sum`` or ``cones``."""
    values: tuple[float, ...]
    """Values that were tried."""
    points: tuple[RestPoint, ...]
    """By value; with cones the end of each run."""

    @property
    def jams(self) -> tuple[float, ...]:
        """Values at which there is a jam."""
        return self._values("jam")

    @property
    def collisions(self) -> tuple[float, ...]:
        """Values at which the robot hits a box; with cones alone."""
        return self._values("collision")

    def _values(self, outcome: str) -> tuple[float, ...]:
        return tuple(sorted({p.value for p in self.points if p.outcome == outcome}))

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return vars(self) | {"jams": self.jams, "collisions": self.collisions}


def local_minima(model: PointMass, *, cell_m: float) -> NDArray[np.float64]:
    """Cells whose potential is no higher than that of any neighbour.

    Complete up to the grid: a minimum whose basin is narrower than two cells
    may be missed. The ring of follow points, where nothing else pushes, is one
    flat minimum; its cells are all found.

    Args:
        model: Bodies, source and gains.
        cell_m: Side of the square cells, m.

    Returns:
        (n, 2) their places in W, m.
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
    # Beyond the grid lies a wall that is lower than all.
    least = potential <= minimum_filter(potential, 3, mode="constant", cval=-np.inf)
    return np.asarray(grid[least & np.isfinite(potential)])


def _refined(
    model: PointMass, point: NDArray[np.float64], cell_m: float
) -> tuple[float, float]:
    """Compass search from a cell: halves its step where no neighbour is lower.

    The first step is short, lest it leave a basin of a few cells.
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
    """Rest points before two boxes on either side of the line to the source.

    Args:
        scenario: Law and gains.
        gaps_m: Distances between the boxes' facing sides, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.

    Returns:
        Places of rest in W, m, by gap.

    Raises:
        InputError: The law is not known.
        InputError: The law has no radial force, or ``sensing`` is unknown.
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
    """Rest points before one box beside the line to the source.

    Args:
        scenario: Law and gains.
        offsets_m: Distances of its centre from the line, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.

    Returns:
        Places of rest in W, m, by offset.

    Raises:
        InputError: The law is not known.
        InputError: The law has no radial force, or ``sensing`` is unknown.
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
    """Of (parameter, values, boxes by value, cell of the grid)."""
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
    """The minima before the boxes, and the lowest one beyond."""
    model = point_mass(case)
    minima = local_minima(model, cell_m=cell_m)
    held = minima[:, 0] < BOX_X_M + BOX_M[0]
    jams: list[tuple[float, float]] = []
    for cell in minima[held]:
        place = _refined(model, cell, cell_m)
        # A search may leave a shallow cell for the goal, or for another jam.
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
    """Where P is at the end, and what became of the run."""
    result = simulate(case)
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
    """A start at rest, boxes in the way, the source behind them on the x axis.

    Args:
        scenario: Law and gains.
        places: Centres of the boxes, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.
        size_m: Extents of each box along and across, m.

    Returns:
        Scenario of 60 s with exact hearing.
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
