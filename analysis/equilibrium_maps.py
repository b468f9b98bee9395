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

from analysis.head_on import head_on
from analysis.ideal_loop import ideal_scenario
from analysis.point_mass import PointMass, point_mass
from diagrams import Scenario, simulate
from systems.collision_vector import collision_vectors, echo_points
from systems.geometry import control_point, rotate
from systems.ideal_obstacle_sensor import nearest_vectors
from systems.impedance import attraction_force, repulsion_force
from systems.signals import FRAME_PERIOD_S
from systems.ultrasonic_array import cone_ranges

__all__ = [
    "EquilibriumMap",
    "RatioMap",
    "RestPoint",
    "TrapStiffness",
    "gap_map",
    "local_minima",
    "offset_map",
    "stiffness_ratio_map",
    "trap_stiffness",
]

#: Footprint of the boxes, m: along and across the line to the source; printed.
BOX_M = (0.05, 0.1)
#: Place of the boxes, and what is left to go behind them, m.
BOX_X_M, TO_GO_M = 2.0, 2.0
#: Bodies of ``trap_stiffness``, m: 1 um stands for a point.
_BODIES_M = {"point": (1e-6, 1e-6), "face": BOX_M}
#: Spacing of the grid on which energies are compared, m.
_CELL_M = 0.02
#: Follow distance of the maps, m: as printed the attraction would end in the
#: master robot, which repels as well.
_FOLLOW_M = 1.2


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
        return {
            "law": self.law,
            "parameter": self.parameter,
            "sensing": self.sensing,
            "values": list(self.values),
            "jams": list(self.jams),
            "collisions": list(self.collisions),
            "points": [vars(p) for p in self.points],
        }


@dataclass(frozen=True, eq=False)
class RatioMap:
    """Head-on equilibria of the active law over k_ref/K_0."""

    ratios: NDArray[np.float64]
    """(n,) k_ref/K_0, K_0 and reach as in the scenario."""
    outer_m: NDArray[np.float64]
    """(n,) where P is held up, m; NaN: nowhere. A saddle: it slips sideways."""
    inner_m: NDArray[np.float64]
    """(n,) nearer in, where the vanishing force gives way, m. A source."""
    to_go_m: float
    """What is left to go behind the obstacle, m."""
    today: float
    """The scenario's ratio."""

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {
            "ratios": self.ratios.tolist(),
            "outer_m": [None if math.isnan(x) else x for x in self.outer_m.tolist()],
            "inner_m": [None if math.isnan(x) else x for x in self.inner_m.tolist()],
            "to_go_m": self.to_go_m,
            "today": self.today,
        }


@dataclass(frozen=True)
class TrapStiffness:
    """What a small sideways step does at the equilibrium before one body."""

    sensing: str
    """``exact`` or ``cones``."""
    body: str
    """``point``, or ``face``: a printed box whose face looks at the robot."""
    equilibrium_m: float
    """Clearance of P, m."""
    along_n_m: float
    """-dF/dx along the line, N/m; positive: P returns."""
    across_n_m: float
    """-dF/dy across it, N/m. The heading turns with P, by dy / epsilon."""

    @property
    def trap(self) -> bool:
        """Whether P returns from any small step."""
        return self.along_n_m > 0.0 and self.across_n_m > 0.0

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        return {**vars(self), "trap": self.trap}


def local_minima(model: PointMass, *, cell_m: float = _CELL_M) -> NDArray[np.float64]:
    """(n, 2) local minima of the potential, to a fraction of a cell, m.

    Complete up to the grid: a minimum whose basin is narrower than two cells
    may be missed. The ring of follow points, where nothing else pushes, is one
    flat minimum; its cells are all found.
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
    inner = potential[1:-1, 1:-1]
    least = np.isfinite(inner)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                shifted = potential[i : i + inner.shape[0], j : j + inner.shape[1]]
                least &= inner <= shifted
    return np.array([_refined(model, p, cell_m) for p in grid[1:-1, 1:-1][least]])


def _refined(
    model: PointMass, point: NDArray[np.float64], cell_m: float
) -> NDArray[np.float64]:
    """Compass search: halves its step where no neighbour is lower."""
    step, here = cell_m, point.copy()
    directions = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float)
    value = float(model.potential(here[None])[0])
    while step > 1e-4:
        tries = here + step * directions
        values = model.potential(tries)
        best = int(np.argmin(values))
        if values[best] < value:
            here, value = tries[best], float(values[best])
        else:
            step *= 0.5
    return here


def gap_map(
    scenario: Scenario,
    gaps_m: Sequence[float] = tuple(np.round(np.arange(0.2, 2.41, 0.1), 2)),
    *,
    sensing: str = "exact nearest",
    progress: Callable[[float], None] | None = None,
) -> EquilibriumMap:
    """Rest points before two boxes on either side of the line to the source.

    Args:
        scenario: Law and gains.
        gaps_m: Distances between the boxes' facing sides, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.
        progress: Called with the share that is done.

    Raises:
        ScenarioError: The law is not known.
        ValueError: The law has no radial force, or ``sensing`` is unknown.
    """

    def boxes(gap: float) -> list[tuple[float, float]]:
        y = 0.5 * (gap + BOX_M[1])
        return [(BOX_X_M, y), (BOX_X_M, -y)]

    return _map(scenario, "gap_m", gaps_m, boxes, sensing, progress)


def offset_map(
    scenario: Scenario,
    offsets_m: Sequence[float] = tuple(np.round(np.arange(0.0, 0.21, 0.02), 2)),
    *,
    sensing: str = "cones",
    progress: Callable[[float], None] | None = None,
) -> EquilibriumMap:
    """Rest points before one box beside the line to the source.

    Args:
        scenario: Law and gains.
        offsets_m: Distances of its centre from the line, m.
        sensing: ``exact nearest``, ``exact sum`` or ``cones``.
        progress: Called with the share that is done.

    Raises:
        ScenarioError: The law is not known.
        ValueError: The law has no radial force, or ``sensing`` is unknown.
    """
    return _map(
        scenario, "offset_m", offsets_m, lambda y: [(BOX_X_M, y)], sensing, progress
    )


def _map(
    scenario: Scenario,
    parameter: str,
    values: Sequence[float],
    boxes: Callable[[float], list[tuple[float, float]]],
    sensing: str,
    progress: Callable[[float], None] | None,
) -> EquilibriumMap:
    if sensing not in ("exact nearest", "exact sum", "cones"):
        raise ValueError(
            f"sensing: {sensing!r} is none of 'exact nearest', 'exact sum', 'cones'"
        )
    values = tuple(float(v) for v in values)
    points = []
    for k, value in enumerate(values):
        case = _case(scenario, boxes(value), sensing)
        found = _end_of_run(case) if sensing == "cones" else _minima(case)
        points += [RestPoint(value, *place, outcome) for *place, outcome in found]
        if progress is not None:
            progress((k + 1) / len(values))
    return EquilibriumMap(scenario.law, parameter, sensing, values, tuple(points))


def _minima(case: Scenario) -> list[tuple[float, float, str]]:
    """The minima before the boxes, and the lowest one beyond."""
    model = point_mass(case)
    minima = local_minima(model)
    held = minima[:, 0] < BOX_X_M + BOX_M[0]
    beyond = minima[~held]
    goal = beyond[[np.argmin(model.potential(beyond))]] if len(beyond) else beyond
    return [(*p, "jam") for p in minima[held].tolist()] + [
        (*p, "goal") for p in goal.tolist()
    ]


def _end_of_run(case: Scenario) -> list[tuple[float, float, str]]:
    """Where P is at the end, and what became of the run."""
    result = simulate(case)
    x, y = (float(result.columns[f"p_WP_{axis}"][-1]) for axis in "xy")
    if result.cause == "collision":
        return [(x, y, "collision")]
    return [(x, y, "jam" if x < BOX_X_M + BOX_M[0] else "goal")]


def _case(
    scenario: Scenario,
    places: list[tuple[float, float]],
    sensing: str,
    size_m: tuple[float, float] = BOX_M,
) -> Scenario:
    """A start at rest, boxes in the way, the source behind them on the x axis."""
    data = ideal_scenario(scenario).model_dump() | {
        "duration_s": 60.0,
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "obstacles": [
            {"name": f"box {k + 1}", "size_m": list(size_m), "waypoints_m": [list(p)]}
            for k, p in enumerate(places)
        ],
    }
    source = {"waypoints_m": [[BOX_X_M + TO_GO_M + _FOLLOW_M, 0.0]], "heading_deg": 0.0}
    data["source"] = data["source"] | source
    data["attraction"] = data["attraction"] | {"follow_distance_m": _FOLLOW_M}
    if sensing == "cones":
        data["obstacle_sensing"] = "ultrasonic"
    rule = {"exact nearest": "nearest", "exact sum": "sum"}.get(sensing)
    if rule is not None:
        data["collision_vector"] = data["collision_vector"] | {"aggregation": rule}
    return Scenario.model_validate(data)


def stiffness_ratio_map(
    scenario: Scenario,
    ratios: Sequence[float] = tuple(np.geomspace(1.2, 64.0, 60)),
    *,
    to_go_m: float | None = None,
) -> RatioMap:
    """Head-on equilibria of the active law as k_ref/K_0 varies.

    Args:
        scenario: Its active law's K_0, reach and velocity term.
        ratios: k_ref/K_0, above 1.
        to_go_m: See ``head_on``.
    """
    outer, inner = [], []
    for ratio in ratios:
        case = head_on(_with_ratio(scenario, float(ratio)), to_go_m=to_go_m)
        places = case.equilibria_m
        outer.append(places[0] if places else math.nan)
        inner.append(places[1] if len(places) > 1 else math.nan)
    gains = scenario.repulsion
    return RatioMap(
        np.array(ratios, dtype=float),
        np.array(outer),
        np.array(inner),
        head_on(scenario, to_go_m=to_go_m).to_go_m,
        gains.reference_stiffness_n_m / gains.stiffness_n_m,
    )


def _with_ratio(scenario: Scenario, ratio: float) -> Scenario:
    gains = scenario.repulsion
    changed = gains.model_copy(
        update={"reference_stiffness_n_m": ratio * gains.stiffness_n_m}
    )
    return scenario.model_copy(update={"law": "active", "repulsion": changed})


def trap_stiffness(
    scenario: Scenario, sensing: str, body: str = "point"
) -> TrapStiffness:
    """Stiffness of the blocks' own force at the equilibrium before one body.

    P is on the line to the source, the body straight ahead. The hand-position
    law turns the robot by dy/epsilon where P steps aside by dy.

    Args:
        scenario: Law and gains.
        sensing: ``exact`` or ``cones``.
        body: ``point`` or ``face``.

    Raises:
        ScenarioError: The law is not known.
        ValueError: The law does not hold P before the body, or a word is
            unknown.
    """
    if sensing not in ("exact", "cones"):
        raise ValueError(f"sensing: {sensing!r} is neither 'exact' nor 'cones'")
    if body not in _BODIES_M:
        raise ValueError(f"body: {body!r} is neither 'point' nor 'face'")
    size = _BODIES_M[body]
    case = _case(scenario, [(BOX_X_M, 0.0)], "cones", size)
    contact = head_on(case, to_go_m=TO_GO_M + 0.5 * size[0])
    c, step = contact.equilibrium_m, 1e-4
    x = BOX_X_M - 0.5 * size[0] - c
    law, epsilon = contact.law.function, scenario.robot.control_point_m

    def force(dx: float, dy: float) -> tuple[float, float]:
        return _block_force(case, law, (x + dx, dy, dy / epsilon), sensing)

    return TrapStiffness(
        sensing=sensing,
        body=body,
        equilibrium_m=c,
        along_n_m=-(force(step, 0.0)[0] - force(-step, 0.0)[0]) / (2.0 * step),
        across_n_m=-(force(0.0, step)[1] - force(0.0, -step)[1]) / (2.0 * step),
    )


def _block_force(
    case: Scenario, law: Any, place: tuple[float, float, float], sensing: str
) -> tuple[float, float]:
    """Sum of the forces at rest by the blocks' functions, N in W.

    The place is x and y of P, and the heading.
    """
    x, y, theta = place
    offset = case.robot.control_point_m
    pose = (x - offset * math.cos(theta), y - offset * math.sin(theta), theta)
    bodies = [body.rectangle(0.0) for body in case.bodies().values()]
    if sensing == "exact":
        vectors = nearest_vectors(
            pose, bodies, offset, case.ultrasonic.maximum_range_m, 1
        )
    else:
        ranges = cone_ranges(np.array(pose), np.array(bodies), case.ultrasonic, offset)
        echo = ranges <= case.ultrasonic.maximum_range_m
        points = echo_points(ranges.tolist(), echo.tolist(), case.ultrasonic)
        vectors = collision_vectors(points, case.collision_vector)
    vectors_W = [(v[0], *rotate(theta, v[1], v[2])) for v in vectors]
    term = case.repulsion.velocity_term
    F_b, _ = repulsion_force(vectors_W, {}, law, term, FRAME_PERIOD_S)
    p_WP, p_WS = control_point(pose, offset), case.source.path().pose(0.0)[:2]
    F_m = attraction_force(
        p_WP, (0.0, 0.0), p_WS, True, case.attraction, case.robot.mass_kg
    )
    return float(F_m[0] + F_b[0]), float(F_m[1] + F_b[1])
