"""Results of a sweep as a JSON document, and as text for a terminal."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.reporting.intervals import Estimate
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from analysis.runs.run_table import warning_counts
from analysis.sweeps.estimates import QUANTITIES, Quantity, by_cell, ended, figure_table
from analysis.sweeps.one_run import FAILED
from analysis.sweeps.plan import SweepPlan, SweepPoint
from analysis.sweeps.sweep import reproducing_command

#: Columns with numbers that are not metrics.
_NO_METRICS = ("index", "cell", "run", "seed", "redraws", "wall_s")


def sweep_summary(
    plan: SweepPlan, points: list[SweepPoint], results: pd.DataFrame, out: Path
) -> dict[str, Any]:
    """Makes the JSON document of a parameter sweep.

    Args:
        plan: Plan of the sweep.
        points: All runs of the plan.
        results: Results of the sweep, from ``load_results``.
        out: Directory of the sweep, for the commands that repeat runs.

    Returns:
        Plain values that can be written as JSON.
    """
    failed = results[results["cause"] == FAILED]
    return {
        "schema_version": SCHEMA_VERSION,
        "name": plan.name,
        "scenario": plan.scenario,
        "seed": plan.seed,
        "runs": len(results),
        "failed": len(failed),
        "warnings": [asdict(each) for each in warning_counts(results)],
        "cells": [
            _cell(plan, fields, runs)
            for fields, runs in zip(plan.cells(), by_cell(plan, results), strict=True)
        ],
        "failures": [
            {
                "index": int(row["index"]),
                "seed": int(row["seed"]),
                "error": row["error"],
                "command": reproducing_command(
                    out, points[int(row["index"])], row["engine"]
                ),
            }
            for row in failed.to_dict("records")
        ],
        "timing": {
            "runs_wall_s": float(results["wall_s"].sum()),
            "simulated_s": float(results["simulated_s"].sum()),
        },
        "versions": versions(),
        "out": str(out),
    }


def _cell(
    plan: SweepPlan, fields: dict[str, Any], runs: pd.DataFrame
) -> dict[str, Any]:
    causes = runs["cause"].value_counts()
    whole = ended(runs)
    numbers = runs.select_dtypes("number").columns
    own = {*_NO_METRICS, *plan.paths}
    metrics = [Quantity(name, name, metric=name) for name in numbers if name not in own]
    return {
        "fields": fields,
        "runs": len(runs),
        "causes": {str(cause): int(count) for cause, count in causes.items()},
        "warnings": [asdict(each) for each in warning_counts(runs)],
        **{q.name: _plain(q.estimate(whole), "estimate") for q in QUANTITIES if q.rate},
        "metrics": {q.name: _plain(q.estimate(whole), "median") for q in metrics},
    }


def _plain(estimate: Estimate, name: str) -> dict[str, float | None]:
    values = zip((name, "low", "high"), estimate, strict=True)
    return {key: None if math.isnan(value) else value for key, value in values}


def sweep_text(plan: SweepPlan, results: pd.DataFrame) -> str:
    """Makes a text of the results of a parameter sweep.

    Each cell of the grid has one line with its estimates and their 95 % confidence
    intervals. A cell is one combination of the values in the grid. Each field with
    warnings has one line.

    Args:
        plan: Plan of the sweep.
        results: Results of the sweep, from ``load_results``.

    Returns:
        Lines of text, without a newline after the last line.
    """
    titles, cells = figure_table(plan, results)
    rows = [["cell", "runs", *titles]]
    for (label, *figures), runs in zip(cells, by_cell(plan, results), strict=True):
        rows.append([label, str(len(ended(runs))), *figures])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(text.ljust(w) for text, w in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    failed = int((results["cause"] == FAILED).sum())
    if failed:
        lines.append(f"{failed} of {len(results)} runs failed with an error")
    lines += (
        f"Warning in {each.runs} of {len(results)} runs: {each.field}: {each.message}"
        for each in warning_counts(results)
    )
    return "\n".join(lines)
