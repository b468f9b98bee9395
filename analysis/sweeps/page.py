"""The HTML page of a sweep: endings of the runs, heat maps, marginals and failures."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.reporting.html_page import (
    definitions,
    figure_html,
    heading,
    note,
    paragraph,
    section,
    table,
)
from analysis.reporting.plain_values import write_json
from analysis.reporting.render import page
from analysis.reporting.section import Cell
from analysis.runs.run_table import warning_counts
from analysis.sweeps.estimates import by_cell, cell_label, ended, figure_table
from analysis.sweeps.one_run import FAILED
from analysis.sweeps.plan import SweepPlan, SweepPoint
from analysis.sweeps.plots import grid_axes, plot_heat_maps, plot_line, plot_marginal
from analysis.sweeps.sweep import reproducing_command
from diagrams.running.stop_rules import SUCCESSFUL

#: Limits that keep a page readable.
#: MOST_MAPS: number of heat maps.
#: MOST_ERRORS: number of commands for runs that raised an error.
#: MOST_OTHERS: number of commands for runs with any other cause of failure.
MOST_MAPS, MOST_ERRORS, MOST_OTHERS = 12, 200, 10
#: If there are more cells than this, the tables of cells are at the end of the page.
MOST_CELLS = 24


def write_sweep(
    plan: SweepPlan,
    points: list[SweepPoint],
    results: pd.DataFrame,
    summary: dict[str, Any],
) -> None:
    """Writes the summary and the HTML page of a parameter sweep into its directory.

    The files are ``summary.json`` and ``report.html``.

    Args:
        plan: Plan of the sweep.
        points: All runs of the plan.
        results: Results of the sweep, from ``load_results``.
        summary: JSON document from ``sweep_summary``. It names the directory, which
            must exist.
    """
    out = Path(summary["out"])
    write_json(summary, out / "summary.json")
    (out / "report.html").write_text(
        sweep_page(plan, points, results, summary), "utf-8"
    )


def sweep_page(
    plan: SweepPlan,
    points: list[SweepPoint],
    results: pd.DataFrame,
    summary: dict[str, Any],
) -> str:
    """Makes the HTML page of a parameter sweep.

    Args:
        plan: Plan of the sweep.
        points: All runs of the plan.
        results: Results of the sweep, from ``load_results``.
        summary: JSON document from ``sweep_summary``.

    Returns:
        HTML.
    """
    cells = {"How the runs ended": [_causes(plan, results), _figures(plan, results)]}
    few = len(plan.cells()) <= MOST_CELLS
    parts = {
        "Summary": _about(plan, results, summary),
        **(cells if few else {}),
        "Over the grid": _maps(plan, results),
        "Over the draws": _marginals(plan, results),
        "Example runs": _commands(points, results, Path(summary["out"])),
        **({} if few else cells),
    }
    shown = {title: inner for title, inner in parts.items() if inner}
    contents = [(_anchor(title), title) for title in shown]
    return page(
        f"Sweep {plan.name}: {plan.scenario}",
        contents,
        [section(_anchor(title), title, inner) for title, inner in shown.items()],
    )


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _about(
    plan: SweepPlan, results: pd.DataFrame, summary: dict[str, Any]
) -> list[str]:
    causes = results["cause"].value_counts()
    draws = "all cells have equal" if plan.pair else "each cell has its own"
    rows = [
        ("Scenario", plan.scenario),
        ("Runs", f"{len(results)}: {plan.runs} in each of {len(plan.cells())} cells"),
        ("Ended", ", ".join(f"{count} {cause}" for cause, count in causes.items())),
        ("Seed", f"{plan.seed}; {draws} draws"),
        ("Set", _listed(plan.set)),
        ("Grid", _listed({key: list(v) for key, v in plan.grid.items()})),
        (
            "Draw",
            _listed({k: d.model_dump(exclude_none=True) for k, d in plan.draw.items()}),
        ),
        ("Drawn again", f"{int((results['redraws'] > 0).sum())} runs"),
        ("Simulated", f"{summary['timing']['simulated_s'] / 3600.0:.2f} h"),
        ("Versions", ", ".join(f"{k} {v}" for k, v in summary["versions"].items())),
    ]
    warnings = [
        note(
            f"Warning in {each.runs} of {len(results)} runs: `{each.field}`: "
            f"{each.message}"
        )
        for each in warning_counts(results)
    ]
    return [
        *warnings,
        definitions(rows),
        paragraph(
            "Brackets and bars are 95 % intervals: Wilson's for shares of runs, order "
            "statistics for medians. Runs that raised an error count as errors only; "
            "no other number includes them."
        ),
    ]


def _listed(fields: dict[str, Any]) -> str:
    pairs = [f"`{key}`: {json.dumps(value)}" for key, value in fields.items()]
    return "; ".join(pairs) or "nothing"


def _causes(plan: SweepPlan, results: pd.DataFrame) -> str:
    order = results["cause"].value_counts().index
    good = [cause for cause in SUCCESSFUL if cause in order]
    causes = [*good, *(cause for cause in order if cause not in good)]
    warned = ["with warnings"] if warning_counts(results) else []
    rows: list[list[Cell]] = []
    for fields, runs in zip(plan.cells(), by_cell(plan, results), strict=True):
        counts = [int((runs["cause"] == cause).sum()) for cause in causes]
        counts += [int((runs["warnings"] != "[]").sum()) for _ in warned]
        rows.append([cell_label(fields), len(runs), *counts])
    return table(["cell", "runs", *causes, *warned], rows, caption="Runs by cause")


def _figures(plan: SweepPlan, results: pd.DataFrame) -> str:
    titles, rows = figure_table(plan, results)
    return table(["cell", *titles], rows, caption="Metrics with 95 % intervals")


def _maps(plan: SweepPlan, results: pd.DataFrame) -> list[str]:
    axes = grid_axes(plan)
    if not axes:
        return []
    if len(axes) == 1 and len(plan.grid) == 1:
        caption = f"Every metric over `{axes[0]}`."
        return [figure_html(plot_line(plan, results, axes[0]), "line", caption)]
    (x, y), others = _map_axes(plan)
    cases = [
        dict(zip(others, values, strict=True))
        for values in product(*(plan.grid[path] for path in others))
    ]
    maps = [
        figure_html(
            plot_heat_maps(plan, results, x, y, rest),
            f"map{k}",
            f"Every metric over `{x}` and `{y}`; lighter means more: "
            f"{cell_label(rest)}.",
            scale=True,
        )
        for k, rest in enumerate(cases[:MOST_MAPS])
    ]
    if len(cases) > MOST_MAPS:
        maps.append(paragraph(f"{len(cases) - MOST_MAPS} further maps are left out."))
    return maps


def _map_axes(plan: SweepPlan) -> tuple[list[str], list[str]]:
    """Axes of the maps, the two fields with most values; and the other fields."""
    by_size = sorted(plan.grid, key=lambda path: -len(plan.grid[path]))
    chosen = [path for path in plan.grid if path in by_size[:2]]
    return chosen, [path for path in plan.grid if path not in chosen]


def _marginals(plan: SweepPlan, results: pd.DataFrame) -> list[str]:
    return [
        figure_html(
            plot_marginal(plan, results, key),
            f"marginal{k}",
            f"Every metric over `{key}`, in bins with equal numbers of runs.",
        )
        for k, (key, drawn) in enumerate(plan.draw.items())
        # A list of boxes is no number and is never drawn twice. It has no marginal.
        if drawn.boxes is None and not ended(results).empty
    ]


def _commands(points: list[SweepPoint], results: pd.DataFrame, out: Path) -> list[str]:
    """Commands that repeat the first failed runs of each cause, errors first."""
    parts = [paragraph("Each command repeats one run and makes its replay.")]
    causes = [c for c in results["cause"].value_counts().index if c not in SUCCESSFUL]
    for cause in sorted(causes, key=lambda cause: cause != FAILED):
        runs = results[results["cause"] == cause]
        caption = f"{cause}: {len(runs)} runs"
        most = MOST_ERRORS if cause == FAILED else MOST_OTHERS
        if len(runs) > most:
            caption += f", of which the first {most}"
        parts.append(heading(3, caption))
        parts.append(
            definitions(
                (f"Run {row['index']}", f"{_remark(row)}`{_command(row, points, out)}`")
                for row in runs.head(most).to_dict("records")
            )
        )
    return parts if causes else []


def _command(row: dict[str, Any], points: list[SweepPoint], out: Path) -> str:
    return reproducing_command(out, points[row["index"]], row["engine"])


def _remark(row: dict[str, Any]) -> str:
    if row["cause"] == FAILED:
        return f"{row['error']}: "
    if row["cause"] == "collision":
        return f"{row['collision_object']}, fault of the {row['collision_fault']}: "
    return ""
