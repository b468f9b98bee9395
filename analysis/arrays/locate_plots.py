"""Plots a located source, and writes the files of its result directory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.arrays.cramer_rao import polar_point
from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.place_medians import wrapped_deg
from analysis.report.palette import COLORS, ROBOT_COLORS, draw_grid
from analysis.report.plain_values import write_json

# Longest pause over which a track is drawn, s.
_GAP_S = 0.5

_WIDTH_IN, _PANEL_IN, _PLAN_IN = 9.0, 1.9, 3.6


def write_locate(
    result: LocatedSource, document: dict[str, Any], directory: Path
) -> None:
    """Writes ``locate.json`` and ``locate.png`` into an existing directory."""
    write_json(document, directory / "locate.json")
    plot_locate(result).savefig(directory / "locate.png", dpi=150)


def plot_locate(result: LocatedSource) -> Figure:
    """Plots the angles and the range over time, and a plan view.

    Error bars show one standard deviation.
    """
    known = [
        (name, label)
        for name, label in (
            ("bearing_deg", "bearing (deg)"),
            ("elevation_deg", "elevation (deg)"),
            ("range_m", "range (m)"),
        )
        if any(getattr(e, name) is not None for e in result.estimates)
    ]
    rows = max(len(known), 1)
    height = max(_PLAN_IN, 0.9 + _PANEL_IN * rows)
    figure = Figure(figsize=(_WIDTH_IN, height), layout="constrained")
    grid = figure.add_gridspec(rows, 2, width_ratios=(1.7, 1.0))
    top: Axes | None = None
    for k, (name, label) in enumerate(known):
        axes = figure.add_subplot(grid[k, 0], sharex=top)
        top = top or axes
        _over_time(axes, result, name)
        axes.set_ylabel(label)
        axes.tick_params(labelbottom=k == rows - 1)
        if k == rows - 1:
            axes.set_xlabel("time (s)")
    _plan(figure.add_subplot(grid[:, 1] if known else grid[:, :]), result)
    figure.suptitle(_title(result), fontsize=11)
    return figure


def _title(result: LocatedSource) -> str:
    heard = f"heard in {len(result.estimates)} of {result.frames} frames"
    if result.agreed.doubt:
        heard += f"; {result.agreed.doubt}: the number of sources is unknown"
    elif len(result.agreed.sources) > 1:
        heard += f"; {len(result.agreed.sources)} sources"
    summary = result.main_source()
    if not result.estimates or "range" in summary["observable"]:
        return heard
    if any(each.range_m is not None for each in result.estimates):
        return f"{heard}; no single range"
    return f"{heard}; range not observable"


def _over_time(axes: Axes, result: LocatedSource, name: str) -> None:
    """Plots estimates with error bars, and the summary as a line with an error band."""
    std_name = name.replace("_deg", "_std_deg").replace("_m", "_std_m")
    rows = [
        (e.t_s, getattr(e, name), getattr(e, std_name))
        for e in result.estimates
        if getattr(e, name) is not None
    ]
    times, values, errors = np.array(rows).T
    summary = result.main_source()
    center, std = summary[name], summary[std_name]
    if name == "bearing_deg" and center is not None:
        # A bearing near 180 deg must not jump from the top to the bottom of the plot.
        # The axis labels show the same wrapped bearings as the table.
        middle = _middle_deg(result, center)
        values = middle + (values - middle + 180.0) % 360.0 - 180.0
        center = middle + (center - middle + 180.0) % 360.0 - 180.0
        axes.yaxis.set_major_formatter(
            lambda value, _: f"{wrapped_deg(round(value, 6)):g}"
        )
        _tracks(axes, result, middle)
    axes.errorbar(
        times,
        values,
        yerr=errors,
        fmt="o",
        markersize=3.0,
        linewidth=0.8,
        color=COLORS["estimate"],
    )
    if center is not None:
        axes.axhline(center, color=COLORS["source"], linewidth=1.2)
        ends = center - std, center + std
        axes.axhspan(*ends, color=COLORS["source"], alpha=0.15, linewidth=0)
    draw_grid(axes)


def _others(axes: Axes, result: LocatedSource, length: float) -> None:
    main = result.main_source()["bearing_deg"]
    if main is None or len(result.agreed.sources) < 2:
        return
    bearings = [source.bearing_deg for source in result.agreed.sources]
    off = [abs((bearing - main + 180.0) % 360.0 - 180.0) for bearing in bearings]
    del bearings[int(np.argmin(off))]
    for k, bearing in enumerate(bearings):
        x, y = polar_point(length, bearing)
        label = "further sources" if k == 0 else None
        axes.plot((0, x), (0, y), "-.", color=COLORS["source"], label=label)


def _middle_deg(result: LocatedSource, main: float) -> float:
    """Returns the bearing opposite the widest gap between the sources, deg.

    If there are fewer than two sources, it is the bearing of the main source.
    """
    bearings = np.sort([source.bearing_deg for source in result.agreed.sources])
    if len(bearings) < 2:
        return main
    gaps = np.diff(bearings, append=bearings[0] + 360.0)
    widest = int(gaps.argmax())
    return float(bearings[widest] + 0.5 * gaps[widest] - 180.0)


def _tracks(axes: Axes, result: LocatedSource, middle: float) -> None:
    """Plots each track in its own color if there are several. Pauses stay blank."""
    if len(result.agreed.tracks) < 2:
        return
    for k, track in enumerate(result.agreed.tracks):
        t_s, bearing = np.array(track.t_s), np.array(track.bearing_deg)
        around = middle + (bearing - middle + 180.0) % 360.0 - 180.0
        steps = np.diff(around, prepend=around[0]), np.diff(t_s, prepend=t_s[0])
        around[(np.abs(steps[0]) > 180.0) | (steps[1] > _GAP_S)] = np.nan
        color = ROBOT_COLORS[k % len(ROBOT_COLORS)]
        axes.plot(t_s, around, color=color, label=f"{track.identity}")
    axes.legend(
        fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=8
    )


def _plan(axes: Axes, result: LocatedSource) -> None:
    places = result.shape.p_AM[:, :2]
    ranges = [e.range_m for e in result.estimates if e.range_m is not None]
    size = max(1.6 * float(np.abs(places).max()), 1.15 * max(ranges, default=0.0))
    for e in result.estimates:
        if e.bearing_deg is not None:
            x, y = polar_point(e.range_m or 0.85 * size, e.bearing_deg)
            axes.plot((0, x), (0, y), color=COLORS["estimate"], alpha=0.25)
    summary = result.main_source()
    if summary["bearing_deg"] is not None:
        x, y = polar_point(0.95 * size, summary["bearing_deg"])
        axes.plot((0, x), (0, y), color=COLORS["source"], label="source")
        for other in summary["alternatives"]:
            if math.isclose(other["bearing_deg"], summary["bearing_deg"], abs_tol=0.5):
                continue  # the mirror image has the same bearing
            x, y = polar_point(0.95 * size, other["bearing_deg"])
            axes.plot((0, x), (0, y), "--", color=COLORS["empty"], label="or")
    _others(axes, result, 0.95 * size)
    axes.plot(*places.T, "o", color=COLORS["robot"], markersize=4, label="microphones")
    for k, (x, y) in enumerate(places):
        axes.annotate(
            f"{k + 1}", (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8
        )
    axes.set(aspect="equal", xlim=(-size, size), ylim=(-size, size))
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.legend(
        fontsize=8,
        frameon=False,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=3,
    )
