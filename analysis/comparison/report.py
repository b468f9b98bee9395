"""The JSON document and the files of a comparison."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from analysis.comparison.cells import ExampleRun, LawCell
from analysis.comparison.compare import (
    EXAMPLES,
    PICTURE,
    RATES,
    REPORT,
    SUMMARY,
    PreparedComparison,
)
from analysis.comparison.laws_in_pairs import Comparison, Pair
from analysis.reporting.file_names import distinct_names
from analysis.reporting.plain_values import write_json
from analysis.reporting.provenance import SCHEMA_VERSION, versions
from diagrams import RunResult, dump_scenario, simulate

#: Key of an example: name of the scenario, number of the run, and kind of the example.
_Key = tuple[str, int, str]


def compare_summary(
    prepared: PreparedComparison,
    comparisons: dict[str, Comparison],
    pooled: Sequence[Pair],
) -> dict[str, Any]:
    """Makes the JSON document of a comparison.

    Args:
        prepared: Plans and directory of the comparison.
        comparisons: Results of each scenario, by the scenario's name.
        pooled: Comparisons of each pair of control laws over all scenarios together.

    Returns:
        Plain values that can be written as JSON.
    """
    plan = next(iter(prepared.sweeps.values())).plan
    cells, pairs = [], []
    files = _example_files(comparisons)
    for name, comparison in comparisons.items():
        for cell in comparison.cells:
            examples = [
                {
                    **asdict(example),
                    "scenario_file": (file := files[_key(cell, example)]),
                    "command": _command(prepared.out, file),
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
    pooled: Sequence[Pair],
    summary: dict[str, Any],
) -> None:
    """Writes the summary, pictures, page and examples of a comparison.

    The function writes these files into the directory of the comparison:

    - ``summary.json``: the JSON document.
    - ``rates.png``: rates and medians of all control laws.
    - One picture of example runs per scenario.
    - ``report.html``: a page that shows the results and the pictures.
    - ``examples/``: a scenario file for each example, so that users can repeat the run.
      For the typical run of each law, the folder also contains a replay.

    Args:
        prepared: Prepared comparison, whose directory exists.
        comparisons: Results of each scenario, by the scenario's name.
        pooled: Comparisons of each pair of laws over all scenarios together.
        summary: JSON document from ``compare_summary``.
    """
    from analysis.comparison.page import comparison_page
    from analysis.comparison.plots import plot_examples, plot_rates

    out = prepared.out
    (out / EXAMPLES).mkdir(exist_ok=True)
    files = _example_files(comparisons)
    plot_rates(list(comparisons.values())).savefig(out / RATES, dpi=150)
    for name, comparison in comparisons.items():
        rows = [
            (cell, list(_run_examples(prepared, cell, files)))
            for cell in comparison.cells
        ]
        folder = prepared.sweeps[name].store.out
        plot_examples(rows).savefig(out / f"{folder.name}{PICTURE}", dpi=150)
    write_json(summary, out / SUMMARY)
    (out / REPORT).write_text(
        comparison_page(summary, comparisons, pooled, out), "utf-8"
    )


def _run_examples(
    prepared: PreparedComparison, cell: LawCell, files: dict[_Key, str]
) -> Iterator[RunResult]:
    """Repeats a cell's examples; writes their scenarios and the typical replay."""
    from analysis.views.replay import write_replay

    sweep = prepared.sweeps[cell.scenario]
    for example in cell.examples:
        point = sweep.points[example.index]
        text = f"layout {point.run} of a comparison, {example.kind} of {cell.label}"
        scenario = sweep.plan.scenario_of(point).model_copy(
            update={"description": text}
        )
        file = prepared.out / files[_key(cell, example)]
        file.write_text(dump_scenario(scenario), "utf-8")
        result = simulate(scenario, engine=sweep.engine(scenario))
        if example.kind == "typical":
            write_replay(result, file.with_suffix(".html"))
        yield result


def _example_files(comparisons: dict[str, Comparison]) -> dict[_Key, str]:
    """Scenario file of each example, relative to the comparison's directory."""
    labels = {
        _key(cell, example): re.sub(
            r"[^\w.]+", "-", f"{cell.scenario} {cell.label} {example.kind}"
        )
        for comparison in comparisons.values()
        for cell in comparison.cells
        for example in cell.examples
    }
    names = distinct_names(labels.values())
    return {
        key: f"{EXAMPLES}/{name}.yaml" for key, name in zip(labels, names, strict=True)
    }


def _key(cell: LawCell, example: ExampleRun) -> _Key:
    return cell.scenario, example.index, example.kind


def _command(out: Path, file: str) -> str:
    return shlex.join(["phonotaxis", "simulate", str(out / file)])
