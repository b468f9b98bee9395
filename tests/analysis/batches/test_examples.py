"""Examples of a comparison: their pictures and the names of their files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from analysis.batches.batch import Batch, Summary
from analysis.batches.cells import EXAMPLES, Cell, ExampleRun
from analysis.batches.examples import example_files, plot_examples
from analysis.batches.plan import SweepPlan
from analysis.report.intervals import estimate_rate

RUNS = tuple(
    ExampleRun(kind, index, "completed") for index, kind in enumerate(EXAMPLES)
)


def cell(law: str, examples: tuple[ExampleRun, ...] = RUNS) -> Cell:
    return Cell(
        scenario="s",
        fields={"law": law},
        runs=50,
        causes={"completed": 50},
        mechanisms={},
        success=estimate_rate(50, 50),
        collision=estimate_rate(0, 50),
        metrics={},
        examples=examples,
        warnings=[],
    )


def test_examples_are_a_row_a_law(crossing_run, collision_run):
    rows = [
        (cell("none"), [collision_run, crossing_run, crossing_run]),
        (cell("active"), [crossing_run, crossing_run]),
    ]
    figure = plot_examples(rows)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0].startswith("law none, worst: collision with box")
    assert titles[4].startswith("law active, typical: completed")
    assert titles[5] == ""
    x_low, x_high = figure.axes[0].get_xlim()
    assert x_low < min(crossing_run.columns["p_WB_x"]) - 0.4
    assert x_high > max(crossing_run.columns["p_WS_x"]) + 0.3


def test_examples_of_laws_whose_names_are_alike_have_files_of_their_own():
    others = tuple(replace(run, index=run.index + 3) for run in RUNS)
    plan = SweepPlan(grid={"law": ("a.py:f", "a.py-f")})
    cells = [cell("a.py:f"), cell("a.py-f", others)]
    batch = Batch(
        "", Path(), {}, {"s": Summary("s", plan, pd.DataFrame(), cells, [])}, []
    )
    files = example_files(batch)
    assert len(set(files.values())) == 6
    assert files["s", 0, "worst"] == "examples/s-law-a.py-f-worst.yaml"
    assert files["s", 3, "worst"] == "examples/s-law-a.py-f-worst-2.yaml"


def test_a_sweep_without_laws_has_no_examples():
    for plan in (SweepPlan(grid={"hearing": ("ideal",)}), SweepPlan(pair=False)):
        summary = Summary("s", plan, pd.DataFrame(), [cell("none")], [])
        assert example_files(Batch("", Path(), {}, {"s": summary}, [])) == {}
