"""Example runs of a batch: their scenario files, replays and pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from analysis.batches.batch import EXAMPLES, Batch, compares_laws
from analysis.batches.cells import Cell, ExampleRun
from analysis.report.file_names import distinct_names
from analysis.views.framing import bounds
from analysis.views.picture import draw_scene
from analysis.views.scene import make_scene
from diagrams import RunResult, dump_scenario, simulate

#: Key of an example: name of the scenario, number of the run, and kind of the example.
ExampleKey = tuple[str, int, str]


def example_cells(batch: Batch) -> list[Cell]:
    """Cells whose examples the report shows: those of sweeps that compare laws."""
    return [
        cell
        for each in batch.summaries.values()
        if compares_laws(each.plan)
        for cell in each.cells
    ]


def example_key(cell: Cell, example: ExampleRun) -> ExampleKey:
    """Key of an example in ``example_files``."""
    return cell.scenario, example.index, example.kind


def example_files(batch: Batch) -> dict[ExampleKey, str]:
    """Scenario file of each example, relative to the directory of the batch."""
    labels = {
        example_key(cell, example): re.sub(
            r"[^\w.]+", "-", f"{cell.scenario} {cell.label} {example.kind}"
        )
        for cell in example_cells(batch)
        for example in cell.examples
    }
    names = distinct_names(labels.values())
    return {
        key: f"{EXAMPLES}/{name}.yaml" for key, name in zip(labels, names, strict=True)
    }


def picture_files(batch: Batch) -> dict[str, str]:
    """Picture of the examples of each scenario, relative to the batch's directory."""
    names = distinct_names(batch.summaries)
    return {
        scenario: f"{EXAMPLES}/{name}.png"
        for scenario, name in zip(batch.summaries, names, strict=True)
    }


def write_examples(batch: Batch) -> None:
    """Repeats the example runs of a batch, and writes them into its directory.

    The function writes these files into the folder ``examples``. A sweep that does not
    compare laws has no examples.

    - A scenario file of each example, with which users can repeat the run.
    - A replay of the typical run of each cell, as an HTML page.
    - One picture per scenario, which shows all examples of this scenario.
    """
    files, pictures = example_files(batch), picture_files(batch)
    if not files:
        return
    (batch.out / EXAMPLES).mkdir(exist_ok=True)
    for scenario, picture in pictures.items():
        rows = [
            (cell, list(_run_examples(batch, cell, files)))
            for cell in example_cells(batch)
            if cell.scenario == scenario and cell.examples
        ]
        if rows:
            plot_examples(rows).savefig(batch.out / picture, dpi=150)


def _run_examples(
    batch: Batch, cell: Cell, files: dict[ExampleKey, str]
) -> Iterator[RunResult]:
    """Repeats the examples of a cell; writes scenarios, and a replay of one run."""
    from analysis.views.replay import write_replay

    sweep = batch.sweeps[cell.scenario]
    for example in cell.examples:
        point = sweep.points[example.index]
        text = f"layout {point.run} of a comparison, {example.kind} of {cell.label}"
        scenario = sweep.plan.scenario_of(point).model_copy(
            update={"description": text}
        )
        file = batch.out / files[example_key(cell, example)]
        file.write_text(dump_scenario(scenario), "utf-8")
        result = simulate(scenario, engine=sweep.engine(scenario))
        if example.kind == "typical":
            write_replay(result, file.with_suffix(".html"))
        yield result


def plot_examples(rows: Sequence[tuple[Cell, Sequence[RunResult]]]) -> Figure:
    """Draws each cell in a row: worst, typical and best run from above, in W, m."""
    results = [result for _, runs in rows for result in runs]
    limits = np.array([bounds(result, margin=0.6) for result in results])
    x_low, y_low = limits[:, 0].min(), limits[:, 2].min()
    x_high, y_high = limits[:, 1].max(), limits[:, 3].max()
    width = 4.2
    height = width * (y_high - y_low) / (x_high - x_low) + 0.45
    figure = Figure(figsize=(3 * width, len(rows) * height), layout="constrained")
    grid = figure.subplots(len(rows), 3, squeeze=False, sharex=True, sharey=True)
    for panels, (cell, runs) in zip(grid, rows, strict=True):
        for panel in panels[len(runs) :]:
            panel.set_axis_off()
        for panel, example, result in zip(panels, cell.examples, runs, strict=False):
            draw_scene(panel, make_scene(result), ends_only=True)
            ending = f"{result.ending}, {result.simulated_s:.0f} s"
            panel.set_title(f"{cell.label}, {example.kind}: {ending}", fontsize=9)
            panel.set(aspect="equal", xlim=(x_low, x_high), ylim=(y_low, y_high))
    for panel in grid[-1]:
        panel.set_xlabel("x in W (m)")
    for panel in grid[:, 0]:
        panel.set_ylabel("y in W (m)")
    return figure
