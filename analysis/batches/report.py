"""Results of a batch as a JSON document, as text, and as rows of tables."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from analysis.batches.batch import Batch, Summary, compares_laws
from analysis.batches.cells import (
    Cell,
    Quantity,
    by_cell,
    cell_label,
    quantities,
    text_table,
    value_label,
)
from analysis.batches.examples import example_files, example_key
from analysis.batches.one_run import FAILED
from analysis.batches.pairs import Pair, PairedMedian, PairedRate
from analysis.batches.plan import SweepPlan
from analysis.batches.run_rows import warning_counts
from analysis.batches.sweep import reproducing_command
from analysis.report.plain_values import plain
from analysis.report.provenance import SCHEMA_VERSION, versions
from analysis.runs.metric_table import METRICS


def batch_document(batch: Batch) -> dict[str, Any]:
    """Makes the JSON document of a batch."""
    plan = next(iter(batch.summaries.values())).plan
    tables = [each.rows for each in batch.summaries.values()]
    files = example_files(batch)
    document: dict[str, Any] = plain(
        {
            "schema_version": SCHEMA_VERSION,
            "title": batch.title,
            "scenarios": list(batch.summaries),
            "seed": plan.seed,
            "layouts": plan.runs,
            "runs": sum(map(len, tables)),
            "failed": sum(int((table["cause"] == FAILED).sum()) for table in tables),
            "warnings": warning_counts(pd.concat(tables)),
            "cells": [
                {
                    **vars(cell),
                    "examples": [
                        {
                            **vars(example),
                            "scenario_file": (file := files[key]),
                            "command": shlex.join(
                                ["phonotaxis", "simulate", str(batch.out / file)]
                            ),
                        }
                        for example in cell.examples
                        if (key := example_key(cell, example)) in files
                    ],
                }
                for each in batch.summaries.values()
                for cell in each.cells
            ],
            "pairs": [pair for each in batch.summaries.values() for pair in each.pairs],
            "pooled": batch.pooled,
            "failures": [
                {
                    "scenario": name,
                    "index": int(row["index"]),
                    "seed": int(row["seed"]),
                    "error": row["error"],
                    "command": run_command(batch, name, row),
                }
                for name, each in batch.summaries.items()
                for row in each.rows[each.rows["cause"] == FAILED].to_dict("records")
            ],
            "timing": {
                "runs_wall_s": sum(float(table["wall_s"].sum()) for table in tables),
                "simulated_s": sum(
                    float(table["simulated_s"].sum()) for table in tables
                ),
            },
            "versions": versions(),
            "out": str(batch.out),
        }
    )
    return document


def run_command(batch: Batch, scenario: str, row: Mapping[Any, Any]) -> str:
    """Returns the shell command that repeats the run of a row in the results."""
    sweep = batch.sweeps[scenario]
    return reproducing_command(
        sweep.store.out, sweep.points[row["index"]], row["engine"]
    )


def batch_text(batch: Batch, document: dict[str, Any]) -> str:
    """Makes tables of a batch for a terminal, without a newline after the last line."""
    lines = ["Brackets are 95 % intervals.", ""]
    for name, each in batch.summaries.items():
        lines += [f"{name}:"] if len(batch.summaries) > 1 else []
        lines += [*text_table(estimate_rows(each)), ""]
        if compares_laws(each.plan):
            lines += [*_endings(each.cells), ""]
        lines += [*_pair_lines(each.pairs), *warning_lines(each)]
    if batch.pooled and len(batch.summaries) > 1:
        lines += ["all together:", *_pair_lines(batch.pooled)]
    if document["failed"]:
        lines.append(
            f"{document['failed']} of {document['runs']} runs failed with an error"
        )
    examples = [each for cell in document["cells"] for each in cell["examples"]]
    if examples:
        lines += ["", "Example runs:"]
        lines += [f"  {each['command']}   ({each['cause']})" for each in examples]
    return "\n".join(lines).rstrip()


def estimate_rows(summary: Summary) -> list[list[str]]:
    """Returns the rows of a table: a heading, then the estimates of each cell."""
    shown = quantities(summary.rows, seed=summary.plan.seed)
    rows = [["cell", "runs", *(quantity.label for quantity in shown)]]
    for cell in summary.cells:
        figures = [_text_of(cell, quantity) for quantity in shown]
        rows.append([cell.label, str(cell.runs), *figures])
    return rows


def robot_rows(summary: Summary) -> list[list[str]]:
    """Returns the rows of a table of all robots, with a heading.

    Each robot has one row in each cell of the sweep. A cell is one combination of the
    varied values. There are no rows if the scenario has only one robot.
    """
    names = {robot: quantities(summary.rows, robot=robot) for robot in summary.robots}
    if not any(names.values()):
        return []
    metrics = dict.fromkeys(
        q.name.rpartition(".")[2] for x in names.values() for q in x
    )
    rows = [["cell", "robot", *(Quantity(metric).label for metric in metrics)]]
    for cell in summary.cells:
        for robot in summary.robots:
            figures = (_text_of(cell, Quantity(f"{robot}.{x}")) for x in metrics)
            rows.append([cell.label, robot, *figures])
    return rows


def turn_rows(plan: SweepPlan, runs: pd.DataFrame, key: str) -> list[list[str]]:
    """Returns the rows of a table: a heading, then the endings with each listed value.

    The argument ``key`` is a key of ``plan.draw`` whose values occur in turn.
    """
    path = key.partition(",")[0].strip()
    cells = by_cell(plan, runs)
    rows = [[path, *map(cell_label, plan.cells())]]
    for value in dict.fromkeys(runs[path]):
        own = (cell[cell[path] == value]["cause"] for cell in cells)
        counts = (counts_text(causes.value_counts().to_dict()) for causes in own)
        rows.append([value_label(path, value), *counts])
    return rows


def _text_of(cell: Cell, quantity: Quantity) -> str:
    if quantity.rate:
        return quantity.text(getattr(cell, quantity.name))
    found = cell.metrics.get(quantity.name)
    return "-" if found is None else quantity.text(found)


def pair_rows(pairs: Sequence[Pair], *, pictures: bool = False) -> list[list[str]]:
    """Returns the rows of a table: a heading, then the differences of each pair.

    If ``pictures`` is true, metrics that only tables show are omitted.
    """
    shown = [
        Quantity(name)
        for name, metric in METRICS.items()
        if metric.shown == "picture" or (metric.shown and not pictures)
        if any(name in pair.metrics for pair in pairs)
    ]
    rates = Quantity("success"), Quantity("collision")
    rows = [["first less second", *(each.label for each in (*rates, *shown))]]
    for pair in pairs:
        found: dict[str, PairedRate | PairedMedian] = {**pair.metrics}
        found |= {"success": pair.success, "collision": pair.collision}
        rows.append([pair.label, *(_difference(found, q) for q in (*rates, *shown))])
    return rows


def _difference(
    found: Mapping[str, PairedRate | PairedMedian], quantity: Quantity
) -> str:
    pair = found.get(quantity.name)
    if pair is None:
        return "-"
    return f"{quantity.text(pair.difference, '+')} p {pair.p_value:.2g}"


def _pair_lines(pairs: list[Pair]) -> list[str]:
    return [*text_table(pair_rows(pairs, pictures=True)), ""] if pairs else []


def _endings(cells: list[Cell]) -> Iterator[str]:
    for cell in cells:
        yield f"{cell.label}: {counts_text(cell.causes)}"
        if cell.mechanisms:
            yield f"    failures: {counts_text(cell.mechanisms)}"


def counts_text(counts: dict[str, int]) -> str:
    """Lists names with their counts, for example ``reached 40, stuck 2``."""
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def warning_lines(summary: Summary) -> list[str]:
    """Returns one line for each field of the scenario with warnings."""
    return [
        f"Warning in {each.runs} of {len(summary.rows)} runs: {each.field}: "
        f"{each.message}"
        for each in warning_counts(summary.rows)
    ]
