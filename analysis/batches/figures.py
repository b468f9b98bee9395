"""Figures of a batch, for papers."""

from __future__ import annotations

import re

from matplotlib.figure import Figure

from analysis.batches.batch import Batch
from analysis.batches.plots import numbers_of, plot_cells, plot_over, split_field


def batch_figures(batch: Batch) -> dict[str, Figure]:
    """Draws all cells of each scenario, and rates over each number, by name."""
    figures = {}
    for summary in batch.summaries.values():
        plan, rows, scenario = summary.plan, summary.rows, summary.name
        figures[f"{scenario}_cells"] = plot_cells(plan, rows)
        by = split_field(plan)
        for over in numbers_of(plan):
            for quantity in ("success", "collision"):
                name = re.sub(r"\W+", "_", over)
                figures[f"{scenario}_{quantity}_over_{name}"] = plot_over(
                    plan, rows, quantity, over, by if by != over else ""
                )
    return figures
