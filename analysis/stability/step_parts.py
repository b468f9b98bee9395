"""Part of the stability report: the linear model against simulation."""

from __future__ import annotations

from typing import Any

from analysis.linear.operating_point_plots import plot_step
from analysis.linear.step_response import Oscillation, StepCheck, check_step
from analysis.reporting.html_page import Cell, figure_html, paragraph, table
from analysis.stability.law_analysis import Part

__all__ = ["step_parts"]


def step_parts(*, full: bool) -> tuple[Part, ...]:
    """A small step of the nonlinear loop beside its linear model."""
    return (
        Part(
            "step",
            "Prediction against simulation",
            lambda study: check_step(study.scenario, full=full),
            _render_step,
            document=_step_document,
        ),
    )


def _step_document(data: StepCheck) -> dict[str, Any]:
    names = ("predicted", "ideal", "full", "step_m", "frequency_error", "damping_error")
    return {"step": {name: getattr(data, name) for name in names}}


def _render_step(data: StepCheck, name: str) -> list[str]:
    found: list[tuple[str, Oscillation | None]] = [
        ("predicted by the linear model", data.predicted),
        ("simulated, exact sensors", data.ideal),
        ("simulated, the scenario's own sensors", data.full),
    ]
    rows: list[list[Cell]] = [
        [title, each.frequency_rad_s, each.damping_ratio]
        for title, each in found
        if each
    ]
    return [
        paragraph(
            f"P starts {data.step_m:g} m off the operating point, along the line to "
            f"the source. Exact sensors: {100.0 * data.frequency_error:.2f} % off in "
            f"frequency and {100.0 * data.damping_error:.2f} % in damping. The "
            "scenario's own sensors (in a full report) differ more: echoes of cones "
            "are not nearest points, and hearing has its noise and its silences."
        ),
        table(["", "rad/s", "damping ratio"], rows),
        figure_html(plot_step(data), name, "A small step, predicted and simulated."),
    ]
