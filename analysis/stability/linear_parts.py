"""Linear parts of the stability report: operating points, models, and a small step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.linear.linear_plots import plot_equilibria, plot_step
from analysis.linear.step_response import Oscillation, StepCheck, check_step
from analysis.models.equilibria import EquilibriumSearch, find_equilibria
from analysis.models.linear_models import LinearModel, Mode
from analysis.models.linearisation import (
    GradientCheck,
    RouteComparison,
    check_gradient,
    compare_routes,
    continuous_model,
    sampled_model,
)
from analysis.models.operating_points import OperatingPoint, moving_equilibrium
from analysis.reporting.html_page import (
    ZERO,
    Cell,
    figure_html,
    note,
    number,
    paragraph,
    table,
)
from analysis.stability.law_analysis import Part, Study
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
    """Stable equilibrium about which the loop is linearized.
    ``EquilibriumSearch.follow_point`` chooses this equilibrium."""
    moving: OperatingPoint | None
    """The equilibrium of a robot behind a source that moves at constant velocity. None
    if there is no such equilibrium."""
    no_moving: str
    """Reason why ``moving`` is None. Empty if ``moving`` exists."""


@dataclass(frozen=True)
class LinearModels:
    """Linear models of the loop about the operating point, with checks."""

    at: OperatingPoint
    continuous: LinearModel
    sampled: LinearModel
    routes: RouteComparison
    gradient: GradientCheck


def linear_parts(*, full: bool) -> tuple[Part, ...]:
    """Returns the parts about operating points, linear models, and a small step.

    The part about operating points is the first one, because all other parts of the
    report depend on it.

    Args:
        full: Whether the small step is also simulated with the sensors of the scenario.

    Returns:
        Three parts, in the order of the report.
    """
    return (
        Part(
            "equilibria",
            "Operating points",
            _operating_points,
            _render_points,
            document=_points_document,
            notes=lambda data: data.search.notes,
        ),
        Part(
            "linear_models",
            "Linear models",
            _linear_models,
            _render_models,
            fresh=True,
            document=_models_document,
            models=lambda data: (data.continuous, data.sampled, data.at.motion),
        ),
        Part(
            "step",
            "Prediction against simulation",
            lambda study: check_step(study.scenario, full=full),
            _render_step,
            document=_step_document,
        ),
    )


def _operating_points(study: Study) -> OperatingPoints:
    search = find_equilibria(study.scenario)
    at = search.follow_point()
    try:
        return OperatingPoints(search, at, moving_equilibrium(study.scenario), "")
    except InputError as error:
        return OperatingPoints(search, at, None, str(error))


def point_document(point: OperatingPoint) -> dict[str, Any]:
    """Returns an operating point as an entry of the list ``equilibria`` in the JSON."""
    return {
        "position_W": point.p_WP,
        "heading_rad": point.theta_WB,
        "kind": point.kind,
        "stable": point.stable,
        "continuum": point.continuum,
        "source_distance_m": point.source_distance_m,
        "offset_m": point.offset_m,
        "clearance_m": point.clearance_m,
        "nearest_body": point.nearest_body,
        "force_n": point.force_n,
        "stiffness_n_m": point.stiffness_n_m,
        "velocity_W": point.v_WS,
        "eigenvalues": point.eigenvalues,
    }


def _points_document(data: OperatingPoints) -> dict[str, Any]:
    search = data.search
    return {
        "equilibria": [point_document(point) for point in search.points],
        "equilibrium_search": {
            "statement": search.statement,
            "complete": search.complete,
            "area_m": search.area_m,
            "smallest_cell_m": search.cell_m,
            "cells": search.cells,
            "unresolved": search.unresolved,
            "switching": [vars(point) for point in search.switching],
        },
        "operating_point": point_document(data.at),
        "moving_equilibrium": point_document(data.moving)
        if data.moving
        else {"problem": data.no_moving},
    }


def _render_points(data: OperatingPoints, name: str) -> list[str]:
    rows: list[list[Cell]] = [_point_row(point) for point in data.search.points]
    headings = [
        "x (m)", "y (m)", "kind", "from the source (m)", "offset (m)",
        "nearest body", "clearance (m)", "slowest poles (1/s)",
    ]  # fmt: skip
    moving = (
        table(headings, [_point_row(data.moving)], caption="Following a moving source")
        if data.moving
        else note(f"No moving equilibrium: {data.no_moving}.")
    )
    return [
        paragraph(data.search.statement),
        paragraph(
            "The heading at rest is free, so that its neutral poles are left out. The "
            "offset is the distance from the source minus the follow distance. The "
            f"report is about the sink at ({data.at.p_WP[0]:.3f}, "
            f"{data.at.p_WP[1]:.3f}) m."
        ),
        table(headings, rows, caption="Equilibria at rest"),
        moving,
        figure_html(
            plot_equilibria(data.search),
            name,
            "Equilibria of P on the floor, and the force on P.",
        ),
    ]


def _point_row(point: OperatingPoint) -> list[Cell]:
    poles = sorted(point.eigenvalues, key=lambda pole: -pole.real)
    upper = [complex(pole) for pole in poles if pole.imag >= 0.0][:2]
    return [
        *(round(float(value), 6) for value in point.p_WP),
        point.kind + (" (continuum)" if point.continuum else ""),
        point.source_distance_m,
        point.offset_m,
        point.nearest_body,
        point.clearance_m,
        "; ".join(number(pole, 3) for pole in upper),
    ]


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
    return {
        "linear_models": {
            "continuous": _model_document(data.continuous),
            "sampled": _model_document(data.sampled),
            "routes": data.routes,
            "gradient": data.gradient,
        }
    }


def _model_document(model: LinearModel) -> dict[str, Any]:
    return {
        "A": model.A,
        "B": model.B,
        "C": model.C,
        "D": model.D,
        "period_s": model.period_s,
        "state_names": model.state_names,
        "input_names": model.input_names,
        "output_names": model.output_names,
        "poles": model.poles,
    }


def _render_models(data: LinearModels, name: str) -> list[str]:
    routes, check = data.routes, data.gradient
    continuous = data.continuous
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
            "AutoDiff against central differences",
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
        paragraph(
            "The states are deviations from the operating point, in SI units. The "
            "continuous model has no sampling and no tick of latency. The sampled "
            f"model is one period of {tick_ms:g} ms of the built diagram, with "
            f"{routes.states} states; its matrices are in the exported files."
        ),
        table(["check", "of", "largest difference"], checks),
        *(
            matrix_table(continuous, matrix)
            for matrix in ("A", "B", "C", "D")
            if getattr(continuous, matrix).any()
        ),
        _mode_table(continuous.modes, "Modes, continuous"),
        _mode_table(data.sampled.modes, "Modes of the built diagram, as ln(z)/T"),
    ]


def matrix_table(model: LinearModel, matrix: str) -> str:
    """Returns a matrix as an HTML table with the names of its rows and columns.

    A dot in the table is a zero.

    Args:
        model: The linear model with the matrix and the names.
        matrix: Name of the matrix: ``A``, ``B``, ``C``, or ``D``.

    Returns:
        The HTML table.
    """
    x, u, y = model.state_names, model.input_names, model.output_names
    rows, columns = {"A": (x, x), "B": (x, u), "C": (y, x), "D": (y, u)}[matrix]
    body: list[list[Cell]] = [
        [row, *(_element(value) for value in values)]
        for row, values in zip(rows, getattr(model, matrix), strict=True)
    ]
    return table([matrix, *columns], body, dense=len(columns) > _WIDE)


def _element(value: float) -> Cell:
    return ZERO if abs(value) < _ZERO else float(np.round(value, 12))


def _shares(mode: Mode) -> list[str]:
    return [f"{k} {100.0 * v:.0f} %" for k, v in mode.participation.items()]


def _mode_table(modes: Sequence[Mode], caption: str) -> str:
    moving = [m for m in modes if m.frequency_rad_s > _NEUTRAL_1_S]
    rows: list[list[Cell]] = [
        [
            mode.eigenvalue,
            mode.z,
            mode.damping_ratio,
            mode.frequency_rad_s,
            mode.time_constant_s,
            mode.settling_s,
            ", ".join(_shares(mode)[:3]),
        ]
        for mode in moving[:_MODES]
    ]
    faster = len(moving) - len(rows)
    left = f"; left out: {len(modes) - len(moving)} neutral"
    left += f" and {faster} faster ones" if faster else ""
    return table(
        ["pole (1/s)", "z", "damping ratio", "rad/s", "time constant (s)",
         "to 2 % (s)", "participation"],
        rows,
        caption=caption + left,
    )  # fmt: skip


def _step_document(data: StepCheck) -> dict[str, Any]:
    names = ("predicted", "ideal", "full", "step_m", "frequency_error", "damping_error")
    return {"step": {name: getattr(data, name) for name in names}}


def _render_step(data: StepCheck, name: str) -> list[str]:
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
        paragraph(
            f"P starts {data.step_m:g} m off the operating point, along the line to "
            "the source. With exact sensors the prediction is "
            f"{100.0 * data.frequency_error:z.2f} % off in frequency and "
            f"{100.0 * data.damping_error:z.2f} % off in damping. With the sensors of "
            "the scenario (in a full report) the difference is larger: a cone does "
            "not report the nearest point, and hearing has noise and silences."
        ),
        table(["", "rad/s", "damping ratio"], rows),
        figure_html(
            plot_step(data),
            name,
            "A small step: the linear model, released at rest, and simulation. A law "
            "whose velocity term acts from afar pushes once at the beginning of a run.",
        ),
    ]
