"""Draws what was heard in a stream."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from analysis.report.palette import SERIES_COLORS, draw_grid


def plot_tracks(table: pd.DataFrame) -> Figure:
    """Draws the bearings of all sources over time.

    Args:
        table: Table with the columns ``t_s``, ``source`` and ``bearing_deg``, or an
            empty table.

    Returns:
        Figure with one panel, which has one color per source.
    """
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots()
    for k, (source, rows) in enumerate(table.groupby("source") if len(table) else ()):
        color = SERIES_COLORS[k % len(SERIES_COLORS)]
        axes.plot(rows["t_s"], rows["bearing_deg"], ".", color=color, label=str(source))
    if len(table):
        axes.legend(title="source")
    axes.set(xlabel="time (s)", ylabel="bearing (deg)", ylim=(-180.0, 180.0))
    axes.set_yticks(range(-180, 181, 90))
    draw_grid(axes)
    return figure
