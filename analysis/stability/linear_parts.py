"""Linear parts of the stability report: operating points, models, and a small step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.loops.equilibria import EquilibriumSearch, find_equilibria
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.linear_models import LinearModel, Mode
from analysis.loops.linear_plots import plot_equilibria, plot_step
from analysis.loops.linearization import (
    GradientCheck,
    RouteComparison,
    check_gradient,
    compare_routes,
    continuous_model,
    sampled_model,
)
from analysis.loops.operating_points import OperatingPoint, moving_equilibrium
from analysis.loops.step_response import Oscillation, StepCheck, check_step
from analysis.report.criterion import Criterion
from analysis.report.plain_values import pick
from analysis.report.section import (
    ZERO,
    Cell,
    Column,
    Content,
    Figure,
    Note,
    Table,
    number,
)
from analysis.stability.law_analysis import Part, Study
from analysis.stability.margin_parts import least_damped
from analysis.stability.requirements import REQUIRED
from diagrams import Scenario
from systems.framework.input_error import InputError

#: Matrix elements with a smaller magnitude are printed as a dot.
_ZERO = 1e-12
#: Matrices with more columns are printed in small type.
_WIDE = 8
#: Modes with a smaller natural frequency count as neutral, rad/s.
_NEUTRAL_1_S = 1e-6
#: Largest number of modes that a table shows.
_MODES = 12


@dataclass(frozen=True)
class OperatingPoints:
    """Equilibria of the loop. The loop is linearized about one of these equilibria."""

    search: EquilibriumSearch
    at: OperatingPoint
    """Stable equilibrium about which the loop is linearized. It is the result of
    ``EquilibriumSearch.follow_point``."""
    moving: OperatingPoint | None
    """Equilibrium behind a source that moves at constant velocity, if there is one."""
    no_moving: str
    """Reason why ``moving`` is None. Empty if ``moving`` exists."""
    jams: int
    """Number of places outside the goal where the robot can get stuck."""


@dataclass(frozen=True)
class LinearModels:
    """Linear models of the loop about the operating point, with checks."""

    at: OperatingPoint
    continuous: LinearModel
    sampled: LinearModel
    routes: RouteComparison
    """Comparison of two independent computations of the sampled model."""
    gradient: GradientCheck
    """Comparison of AutoDiff with finite differences."""

    @property
    def difference_error(self) -> float | None:
        """Estimated error of an element of A if some derivatives are differences.

        It is the deviation of differences of single laws and blocks from differences of
        the whole diagram with another step. None if Drake differentiates all blocks.
        """
        return self.gradient.largest_difference if self.at.loop.differences() else None


def _model_notes(data: LinearModels) -> list[str]:
    error = data.difference_error
    if error is None:
        return []
    text = (
        f"The error of the differences is estimated as at most {error:.1e} in an "
        "element of the sampled model. This is the largest deviation from differences "
        "of the whole diagram with another step."
    )
    return [text]


def _operating_points(study: Study) -> OperatingPoints:
    scenario = study.scenario
    search = find_equilibria(scenario)
    at, moving, no_moving = search.follow_point(), None, ""
    try:
        moving = moving_equilibrium(scenario)
    except InputError as error:
        no_moving = str(error)
    return OperatingPoints(search, at, moving, no_moving, count_jams(scenario, search))


def count_jams(scenario: Scenario, search: EquilibriumSearch) -> int:
    """Counts the places outside the goal where the robot can get stuck.

    Such a place is a stable equilibrium or an attractive switching point. At a
    switching point, several bodies are equally near, and the force on the robot jumps.
    If a run ends at one of these places, its outcome is "stuck" or "timeout".
    """
    margin = scenario.goal_radius_m - scenario.follower.attraction.follow_distance_m
    p_WS = scenario.source.path().pose(0.0)[:2]
    jams = sum(p.stable and p.offset_m > margin for p in search.points)
    return jams + sum(
        p.attractive and math.dist(p.p_WP, p_WS) > scenario.goal_radius_m
        for p in search.switching
    )


def _points_document(data: OperatingPoints) -> dict[str, Any]:
    search = data.search
    return {
        "points": [_point_document(point) for point in search.points],
        "search": {
            **pick(search, "statement", "complete", "area_m", "cells", "unresolved"),
            "smallest_cell_m": search.cell_m,
            "switching": search.switching,
        },
        "operating_point": _point_document(data.at),
        "moving": _point_document(data.moving)
        if data.moving
        else {"problem": data.no_moving},
        "jams": data.jams,
    }


def _point_document(point: OperatingPoint) -> dict[str, Any]:
    return {
        "position_W": point.p_WP,
        "heading_rad": point.theta_WB,
        "velocity_W": point.v_WS,
        **pick(
            point, "kind", "stable", "continuum", "source_distance_m", "offset_m",
            "clearance_m", "nearest_body", "force_n", "stiffness_n_m", "eigenvalues",
        ),
    }  # fmt: skip


def _show_points(data: OperatingPoints) -> list[Content]:
    return [
        data.search.statement,
        (
            "The heading at rest is free, so that its neutral poles are left out. The "
            "offset is the distance from the source minus the follow distance. The "
            f"report is about the sink at ({data.at.p_WP[0]:.3f}, "
            f"{data.at.p_WP[1]:.3f}) m."
        ),
        _point_table(data.search.points, "Equilibria at rest"),
        _point_table([data.moving], "Following a moving source")
        if data.moving
        else Note(f"No moving equilibrium: {data.no_moving}."),
        Figure(
            lambda: plot_equilibria(data.search),
            "Equilibria of P on the floor, and the force on P.",
        ),
    ]


def _point_table(points: Sequence[OperatingPoint], caption: str) -> Table:
    return Table.of(
        points,
        {
            Column("x", "m"): lambda point: round(float(point.p_WP[0]), 6),
            Column("y", "m"): lambda point: round(float(point.p_WP[1]), 6),
            "kind": lambda point: point.kind + " (continuum)" * point.continuum,
            Column("from the source", "m"): "source_distance_m",
            Column("offset", "m"): "offset_m",
            "nearest body": "nearest_body",
            Column("clearance", "m"): "clearance_m",
            Column("slowest poles", "1/s"): _slowest_poles,
        },
        caption,
    )


def _slowest_poles(point: OperatingPoint) -> str:
    poles = sorted(point.eigenvalues, key=lambda pole: -pole.real)
    upper = [complex(pole) for pole in poles if pole.imag >= 0.0][:2]
    return "; ".join(number(pole, 3) for pole in upper)


def _linear_models(study: Study) -> LinearModels:
    points: OperatingPoints = study.need("equilibria")
    at = points.at
    return LinearModels(
        at,
        continuous_model(at),
        sampled_model(at),
        compare_routes(at),
        check_gradient(at),
    )


def _models_document(data: LinearModels) -> dict[str, Any]:
    names = (
        "A", "B", "C", "D", "period_s", "state_names", "input_names", "output_names",
        "poles",
    )  # fmt: skip
    return {
        "continuous": pick(data.continuous, *names),
        "sampled": pick(data.sampled, *names),
        "routes": data.routes,
        "gradient": data.gradient,
        "difference_error": data.difference_error,
    }


def _show_models(data: LinearModels) -> list[Content]:
    routes, check, continuous = data.routes, data.gradient, data.continuous
    checks: list[list[Cell]] = [
        [
            (
                "two computations: AutoDiff of a whole period, and blocks joined by "
                "`control`"
            ),
            f"{routes.states} states",
            routes.matrix_difference,
        ],
        ["poles of the two computations", "simple, nonzero", routes.pole_difference],
        [
            (
                "AutoDiff against central differences"
                if data.difference_error is None
                else "differences of laws and blocks against those of the diagram"
            ),
            ", ".join(f"`{x}`" for x in check.largest_at),
            check.largest_difference,
        ],
        [
            "corner: left difference against right difference",
            ", ".join(f"`{x}`" for x in check.kink_at),
            check.kink,
        ],
    ]
    tick_ms = 1e3 * (data.sampled.period_s or 0.0)
    return [
        (
            "The states are deviations from the operating point, in SI units. The "
            "continuous model has no sampling and no tick of latency. The sampled "
            f"model is one period of {tick_ms:g} ms of the built diagram, with "
            f"{routes.states} states; its matrices are in the exported files."
        ),
        Table(["check", "of", "largest difference"], checks),
        *(
            _matrix_table(continuous, matrix)
            for matrix in ("A", "B", "C", "D")
            if getattr(continuous, matrix).any()
        ),
        _mode_table(continuous.modes, "Modes, continuous"),
        _mode_table(data.sampled.modes, "Modes of the built diagram, as ln(z)/T"),
    ]


def _matrix_table(model: LinearModel, matrix: str) -> Table:
    """Returns a matrix as a table with names of rows and columns. A dot is a zero."""
    x, u, y = model.state_names, model.input_names, model.output_names
    rows, columns = {"A": (x, x), "B": (x, u), "C": (y, x), "D": (y, u)}[matrix]
    body: list[list[Cell]] = [
        [row, *(_element(value) for value in values)]
        for row, values in zip(rows, getattr(model, matrix), strict=True)
    ]
    return Table([matrix, *columns], body, dense=len(columns) > _WIDE)


def _element(value: float) -> Cell:
    return ZERO if abs(value) < _ZERO else float(np.round(value, 12))


def _mode_table(modes: Sequence[Mode], caption: str) -> Table:
    moving = [m for m in modes if m.frequency_rad_s > _NEUTRAL_1_S]
    left = f"; left out: {len(modes) - len(moving)} neutral"
    if len(moving) > _MODES:
        left += f" and {len(moving) - _MODES} faster ones"
    return Table.of(
        moving[:_MODES],
        {
            Column("pole", "1/s"): "eigenvalue",
            "z": "z",
            "damping ratio": "damping_ratio",
            "rad/s": "frequency_rad_s",
            Column("time constant", "s"): "time_constant_s",
            Column("to 2 %", "s"): "settling_s",
            "participation": _participation,
        },
        caption + left,
    )


def _participation(mode: Mode) -> str:
    shares = [f"{k} {100.0 * v:.0f} %" for k, v in mode.participation.items()]
    return ", ".join(shares[:3])


def _step_document(data: StepCheck) -> dict[str, Any]:
    names = ("predicted", "ideal", "full", "step_m", "frequency_error", "damping_error")
    return pick(data, *names)


def _show_step(data: StepCheck) -> list[Content]:
    found: list[tuple[str, Oscillation | None]] = [
        ("predicted by the linear model", data.predicted),
        ("simulated, exact sensors", data.ideal),
        ("simulated, sensors of the scenario", data.full),
    ]
    rows: list[list[Cell]] = [
        [title, each.frequency_rad_s, each.damping_ratio]
        for title, each in found
        if each
    ]
    return [
        (
            f"P starts {data.step_m:g} m off the operating point, along the line to "
            "the source. With exact sensors the prediction is "
            f"{100.0 * data.frequency_error:z.2f} % off in frequency and "
            f"{100.0 * data.damping_error:z.2f} % off in damping. With the sensors of "
            "the scenario (in a full report) the difference is larger: a cone does not "
            "report the nearest point, and hearing has noise and silences."
        ),
        Table(["", "rad/s", "damping ratio"], rows),
        Figure(
            lambda: plot_step(data),
            "Motion after a release at rest: linear model and simulation. If the "
            "velocity term of the law acts there, it pushes once at the beginning.",
        ),
    ]


def _damping_ratio(data: OperatingPoints) -> float:
    pole = least_damped(data.at.eigenvalues)
    return -pole.real / abs(pole)


#: Equilibria of the loop. All other parts depend on this part.
OPERATING_POINTS = Part[OperatingPoints](
    "equilibria",
    "Operating points",
    _operating_points,
    _show_points,
    criteria=(
        Criterion(
            "growth at rest", "1/s", "below", 0.0,
            "small deviations from the follow point die out",
            "small deviations from the follow point grow",
            "stability",
            lambda data: data.at.eigenvalues.real.max(),
        ),
        Criterion(
            "damping ratio at rest", "", "at least", REQUIRED.damping_ratio,
            "overshoots are small",
            "it overshoots and swings for several cycles",
            "usual: 0.4 to 0.8 (Astrom and Murray)",
            _damping_ratio,
        ),
        Criterion(
            "places where the robot can jam", "", "at most", 0.0,
            "it rests near the follow distance only",
            "it can come to rest away from the source",
            "set by this project; a jam is a place of rest outside the goal of a run",
            lambda data: data.jams,
        ),
        Criterion(
            "offset from the follow point at rest", "m", "at most",
            REQUIRED.rest_offset_m,
            "it rests at the follow distance",
            "obstacles, or the source's own body, push it off that distance",
            "set by this project",
            lambda data: round(abs(data.at.offset_m), 9),
        ),
    ),
    document=_points_document,
    notes=lambda data: (
        *ideal_loop(data.search.scenario).differences(), *data.search.notes
    ),
)  # fmt: skip

LINEAR_MODELS = Part[LinearModels](
    "linear_models",
    "Linear models",
    _linear_models,
    _show_models,
    criteria=(
        Criterion(
            "difference between two computations of the model", "", "at most", 1e-8,
            "two independent computations of the linear model agree",
            "two computations of the linear model differ",
            "rounding",
            lambda data: data.routes.matrix_difference,
        ),
    ),
    document=_models_document,
    models=lambda data: (data.continuous, data.sampled, data.at.motion),
    notes=_model_notes,
)  # fmt: skip

#: A small step, predicted by the linear model and simulated.
STEP = Part[StepCheck](
    "small_step",
    "Prediction against simulation",
    lambda study: check_step(study.scenario, full=study.full),
    _show_step,
    criteria=(
        Criterion(
            "error of the linear prediction of a small step", "% off", "at most", 2.0,
            "frequency and damping agree with the nonlinear simulation",
            "the corner of the velocity term at rest has an effect, which no linear "
            "model describes",
            "2 % in frequency and damping, with exact sensors",
            lambda data: 100.0 * max(
                abs(data.frequency_error), abs(data.damping_error)
            ),
        ),
    ),
    document=_step_document,
)  # fmt: skip
