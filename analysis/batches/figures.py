"""Writes figures of a batch as vector files and pictures, for papers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from analysis.batches.batch import Batch, Summary
from analysis.batches.plots import numbers_of, plot_cells, plot_over, split_field

_FORMATS = ("pdf", "svg", "png")


def write_figures(batch: Batch, directory: Path) -> list[Path]:
    """Writes all figures in all formats; the directory is created if necessary."""
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    for summary in batch.summaries.values():
        for name, figure in _figures(summary):
            for ending in _FORMATS:
                path = directory / f"{name}.{ending}"
                # Letters stay letters, so that programs can search and change them.
                with mpl.rc_context({"svg.fonttype": "none", "pdf.fonttype": 42}):
                    figure.savefig(path, dpi=200)
                paths.append(path)
    return paths


def _figures(summary: Summary) -> Iterator[tuple[str, Figure]]:
    plan, rows = summary.plan, summary.rows
    yield f"{summary.name}_cells", plot_cells(plan, rows)
    for over in numbers_of(plan):
        by = split_field(plan)
        for quantity in ("success", "collision"):
            place = re.sub(r"\W+", "_", over)
            figure = plot_over(plan, rows, quantity, over, by if by != over else "")
            yield f"{summary.name}_{quantity}_over_{place}", figure
