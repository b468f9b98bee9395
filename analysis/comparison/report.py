"""The JSON document, the tables and the files of a comparison."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from analysis.comparison.cells import LawCell, Mean, Median
from analysis.comparison.compare import PreparedComparison
from analysis.comparison.laws_in_pairs import Comparison, Pair
from analysis.reporting.intervals import with_interval
from analysis.reporting.plain_values import write_json
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from diagrams import RunResult, dump_scenario, simulate

__all__ = ["compare_summary", "compare_text", "write_comparison"]

#: Columns of the printed table, those that a law has: heading, metric, unit's factor,
#: format.
_COLUMNS = (
    ("clearance cm", "minimum_obstacle_clearance_m", 100.0, ".1f"),
    ("jerk m/s^3", "jerk_rms_m_s3", 1.0, ".2f"),
    ("SPARC", "sparc", 1.0, ".2f"),
    ("reacts m", "reaction_distance_m", 1.0, ".2f"),
    ("error m", "following_error_rms_m", 1.0, ".2f"),
    ("off the way m", "route_deviation_max_m", 1.0, ".2f"),
    ("ripple rad/s", "yaw_ripple_rad_s", 1.0, ".3f"),
)
#: Metrics whose paired differences are printed.
_PAIRED = ("minimum_obstacle_clearance_m", "jerk_rms_m_s3", "sparc")


def compare_summary(
    prepared: PreparedComparison,
    comparisons: dict[str, Comparison],
    pooled: Sequence[Pair],
) -> dict[str, Any]:
    """The JSON document of a comparison.

    Args:
        prepared: Plans and directory.
        comparisons: Cells and pairs by scenario.
        pooled: Pairs of laws over all scenarios together.

    Returns:
        Plain values, to be written as JSON.
    """
    plan = next(iter(prepared.sweeps.values())).plan
    cells, pairs = [], []
    for name, comparison in comparisons.items():
        for cell in comparison.cells:
            examples = [
                {
                    **asdict(example),
                    "scenario_file": _example_file(cell, example.kind),
                    "command": _command(prepared.out, cell, example.kind),
                }
                for example in cell.examples
            ]
            cells.append({**asdict(cell), "scenario": name, "examples": examples})
        pairs += [asdict(pair) for pair in comparison.pairs]
    return {
        "schema_version": SCHEMA_VERSION,
        "layouts": plan.runs,
        "seed": plan.seed,
        "cells": cells,
        "pairs": pairs,
        "pooled": [asdict(pair) for pair in pooled],
        "versions": versions(),
        "out": str(prepared.out),
    }


def write_comparison(
    prepared: PreparedComparison,
    comparisons: dict[str, Comparison],
    summary: dict[str, Any],
) -> None:
    """Writes what belongs beside the runs into the comparison's directory.

    ``summary.json``, ``rates.png``, a picture of examples an experiment, and
    under ``examples/`` a scenario for each of them that can be run again.

    Args:
        prepared: Its directory exists.
        comparisons: Cells and pairs by scenario.
        summary: From ``compare_summary``.
    """
    from analysis.comparison.plots import plot_examples, plot_rates

    out = prepared.out
    (out / "examples").mkdir(exist_ok=True)
    plot_rates(list(comparisons.values())).savefig(out / "rates.png", dpi=150)
    for name, comparison in comparisons.items():
        rows = [
            (cell, list(_run_examples(prepared, cell))) for cell in comparison.cells
        ]
        plot_examples(rows).savefig(out / f"{name}.png", dpi=150)
    write_json(summary, out / "summary.json")


def _run_examples(prepared: PreparedComparison, cell: LawCell) -> Iterator[RunResult]:
    """Runs a cell's examples again, and keeps their scenarios."""
    sweep = prepared.sweeps[cell.scenario]
    for example in cell.examples:
        point = sweep.points[example.index]
        text = f"layout {point.run} of a comparison, {example.kind} of {cell.label}"
        scenario = sweep.plan.scenario_of(point).model_copy(
            update={"description": text}
        )
        file = prepared.out / _example_file(cell, example.kind)
        file.write_text(dump_scenario(scenario), "utf-8")
        yield simulate(scenario, engine=sweep.engine(scenario))


def _example_file(cell: LawCell, kind: str) -> str:
    label = re.sub(r"[^\w.]+", "-", f"{cell.scenario} {cell.label} {kind}")
    return f"examples/{label}.yaml"


def _command(out: Path, cell: LawCell, kind: str) -> str:
    file = str(out / _example_file(cell, kind))
    return shlex.join(["phonotaxis", "simulate", file])


def compare_text(
    summary: dict[str, Any], comparisons: dict[str, Comparison], pooled: Sequence[Pair]
) -> str:
    """Tables for a terminal.

    Args:
        summary: From ``compare_summary``.
        comparisons: Cells and pairs by scenario.
        pooled: Pairs of laws over all scenarios together.

    Returns:
        Lines without an end of line after the last one.
    """
    lines = [
        f"{summary['layouts']} layouts a scenario, seed {summary['seed']}",
        "In brackets: 95 % intervals.",
        "Clearance, reaction, way, ripple: medians of all runs; the rest of successes.",
    ]
    for name, comparison in comparisons.items():
        lines += ["", name, *_cell_lines(comparison.cells)]
        lines += ["", *(line for pair in comparison.pairs for line in _pair_line(pair))]
    if len(comparisons) > 1:
        lines += ["", "all together", *(line for p in pooled for line in _pair_line(p))]
    lines += ["", "Runs to look at:"]
    for cell in summary["cells"]:
        lines += [
            f"  {example['command']}   ({example['cause']})"
            for example in cell["examples"]
        ]
    return "\n".join(lines)


def _cell_lines(cells: list[LawCell]) -> Iterator[str]:
    width = max(len("law"), *(len(cell.label) for cell in cells))
    columns = [
        column for column in _COLUMNS if any(column[1] in c.metrics for c in cells)
    ]
    headings = "".join(f"{title:>21}" for title, *_ in columns)
    yield f"{'law':<{width}}{'success %':>17}{'collision %':>17}{headings}"
    for cell in cells:
        row = f"{cell.label:<{width}}{_rate(cell.success):>17}"
        row += f"{_rate(cell.collision):>17}"
        for _, metric, factor, form in columns:
            row += f"{_median(cell.metrics.get(metric), factor, form):>21}"
        yield row
    for cell in cells:
        yield f"  {cell.label}: {_counts(cell.causes)}"
        if cell.mechanisms:
            yield f"      failures: {_counts(cell.mechanisms)}"


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def _rate(rate: Mean) -> str:
    return with_interval(rate.estimate, rate.low, rate.high, ".0f", factor=100.0)


def _median(median: Median | None, factor: float, form: str) -> str:
    if median is None:
        return "-"
    return with_interval(median.median, median.low, median.high, form, factor=factor)


def _pair_line(pair: Pair) -> Iterator[str]:
    """First less second: rates in points, then medians of paired differences."""
    common = "".join(f", {value}" for value in pair.fields.values())
    text = f"{pair.first} less {pair.second}{common}:"
    for name, rate in (("success", pair.success), ("collision", pair.collision)):
        figures = rate.difference, rate.low, rate.high
        points = with_interval(*figures, "+.0f", factor=100.0)
        text += f" {name} {points} p {rate.p_value:.2g};"
    yield text
    parts = []
    for metric in _PAIRED:
        median = pair.metrics.get(metric)
        if median is not None and median.difference is not None:
            parts.append(
                f"{metric} {median.difference:+.3f} ({median.low:+.3f}, "
                f"{median.high:+.3f}) p {median.p_value:.2g}, {median.pairs} pairs"
            )
    if parts:
        yield "    " + "; ".join(parts)
