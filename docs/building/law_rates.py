"""Picture of the comparison of the papers' laws in ``docs/results_laws.md``."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from analysis.report.palette import COLORS, draw_grid
from docs.building.result_blocks import RESULTS

#: Summary of ``phonotaxis compare``, which has the rates and medians.
SUMMARY = RESULTS / "comparisons" / "laws.json"
#: Key of each column in a cell of the summary, its factor, and its title.
_RATES = {"success": (100.0, "success (%)"), "collision": (100.0, "collision (%)")}
_METRICS = {
    "reaction_distance_m": (1.0, "distance at first push (m)"),
    "jerk_rms_m_s3": (1.0, "rms jerk of successes (m/s$^3$)"),
}


def plot_law_rates() -> Figure:
    """Draws rates and medians of each law, one row per scenario, with 95 % intervals.

    Panels below each other have the same axis, so that scenarios can be compared.
    """
    cells = json.loads(SUMMARY.read_text("utf-8"))["cells"]
    scenarios = list(dict.fromkeys(cell["scenario"] for cell in cells))
    columns = _RATES | _METRICS
    figure = Figure(
        figsize=(11.0, 1.0 + 1.4 * len(scenarios)),
        layout=ConstrainedLayoutEngine(wspace=0.04),
    )
    grid = figure.subplots(
        len(scenarios), len(columns), squeeze=False, sharex="col", sharey=True
    )
    for panels, scenario in zip(grid, scenarios, strict=True):
        own = [cell for cell in cells if cell["scenario"] == scenario]
        panels[0].set_title(scenario, loc="left", fontsize=10)
        for axes, (key, (factor, _)) in zip(panels, columns.items(), strict=True):
            estimates = [
                (cell if key in _RATES else cell["metrics"])[key] for cell in own
            ]
            _draw(axes, estimates, factor)
        laws = [cell["fields"]["law"] for cell in own]
        panels[0].set_yticks(range(len(laws)), laws)
    for axes, (key, (_, title)) in zip(grid[-1], columns.items(), strict=True):
        axes.set_xlabel(title)
        axes.set_xlim(*((-3.0, 103.0) if key in _RATES else (0.0, None)))
    grid[0][0].invert_yaxis()
    return figure


def _draw(axes: Axes, estimates: list[dict[str, Any]], factor: float) -> None:
    low, value, high = (
        factor
        * np.array(
            [[each[key] for key in ("low", "value", "high")] for each in estimates]
        ).T
    )
    axes.errorbar(
        value,
        np.arange(len(value)),
        xerr=[value - low, high - value],
        fmt="o",
        color=COLORS["robot"],
        markersize=4,
        capsize=3,
        linewidth=1,
    )
    axes.margins(y=0.2)
    draw_grid(axes, "x")
