"""Formats and draws what an array can resolve."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.arrays.array_resolution import (
    BEARINGS_DEG,
    DISTANCES_M,
    ELEVATIONS_DEG,
    ArrayResolution,
    PredictedError,
)
from analysis.report.palette import SERIES_COLORS, draw_grid
from analysis.report.plain_values import plain, write_json
from analysis.report.provenance import SCHEMA_VERSION

_SAME = {
    "none": "every direction has delays of its own",
    "front_back": "a direction and its mirror image behind the row have equal delays",
    "mirror": "a direction and its mirror image on the other side of the plane have "
    "equal delays",
}


def resolution_document(found: ArrayResolution) -> dict[str, Any]:
    """Builds the JSON document of ``phonotaxis array``."""
    known = found.geometry.known
    return {
        "schema_version": SCHEMA_VERSION,
        "array": {
            "microphones": [list(place) for place in found.geometry.microphones],
            "kind": known.shape.kind,
            "aperture_m": known.shape.aperture_m,
            "side": known.shape.side,
            "sound_speed_m_s": known.c,
            "sound_speed_std_m_s": known.budget.speed_std,
            "position_std_m": known.budget.position_std,
            "delay_std_s": known.budget.delay_std,
            "largest_range_error": known.largest_range_error,
        },
        "sound": plain(found.sounding),
        "arrival_std_s": found.arrival_std_s,
        "ambiguity": found.ambiguity,
        "angles": list(found.angles),
        "lowest_hz": found.lowest_hz,
        "highest_hz": found.highest_hz,
        "far": [plain(error) for error in found.far],
        "near": [plain(error) for error in found.near],
        "bearings_deg": list(BEARINGS_DEG),
        "farthest_range_m": list(found.farthest_range_m),
        "improvements": [plain(improvement) for improvement in found.improvements],
    }


def resolution_text(found: ArrayResolution) -> str:
    """Formats the report of ``phonotaxis array`` for a terminal."""
    shape, sound = found.geometry.known.shape, found.sounding
    low, high = sound.band_hz
    sizes = (
        f"{shape.count} microphones in a {shape.kind} of {100 * shape.aperture_m:.3g} "
        f"cm, angles: {' and '.join(found.angles) or 'none'}; {_same(found)}"
    )
    heard = (
        f"sound of {sound.seconds:g} s, {sound.snr_db:g} dB over the noise, {low:g} to "
        f"{high:g} Hz, without echoes: arrival times to "
        f"{1e6 * found.arrival_std_s:.2g} us"
    )
    useful = (
        f"echoes of a room disturb most below {found.lowest_hz:.0f} Hz; tones above "
        f"{found.highest_hz:.0f} Hz have several directions"
    )
    lines = [
        sizes,
        heard,
        useful,
        "",
        "standard deviation (part from errors of array and air), far source",
        f"bearing/deg  {'bearing std/deg':>18}"
        + "".join(f"  elevation std at {e:g} deg" for e in _heights(found)),
    ]
    for k, bearing in enumerate(BEARINGS_DEG):
        rows = found.far[k :: len(BEARINGS_DEG)]
        error = rows[0]
        row = f"{bearing:11.0f}  "
        row += _pair(error.bearing_std_deg, error.bearing_systematic_deg, 18)
        row += "".join(
            "  " + _pair(e.elevation_std_deg, e.elevation_systematic_deg, 23)
            for e in rows
            if e.elevation_deg is not None
        )
        lines.append(row)
    return "\n".join([*lines, "", *_ranges(found), "", *_better(found)])


def write_resolution(
    found: ArrayResolution, document: dict[str, Any], directory: Path
) -> None:
    """Writes ``array.json`` and ``array.png`` into an existing directory."""
    write_json(document, directory / "array.json")
    plot_resolution(found).savefig(directory / "array.png", dpi=150)


def plot_resolution(found: ArrayResolution) -> Figure:
    """Draws the errors of the angles and the farthest range over the bearing."""
    panels = ["bearing std (deg)"]
    panels += ["elevation std (deg)"] if "elevation" in found.angles else []
    panels += ["farthest range (m)"] if any(found.farthest_range_m) else []
    figure = Figure(figsize=(7.0, 0.6 + 2.2 * len(panels)), layout="constrained")
    every = np.atleast_1d(figure.subplots(len(panels), sharex=True))
    for axes, label in zip(every, panels, strict=True):
        if label.startswith("farthest"):
            ranges = [r or 0.0 for r in found.farthest_range_m]
            axes.plot(BEARINGS_DEG, ranges, "o-", markersize=3, color=SERIES_COLORS[0])
        else:
            name = label.split()[0]
            for height, color in zip(ELEVATIONS_DEG, SERIES_COLORS, strict=False):
                rows = _at_height(found, height)
                stds = [getattr(e, f"{name}_std_deg") for e in rows]
                values = [np.nan if std is None else std for std in stds]
                if np.isfinite(values).any():
                    shown = f"elevation {height:g} deg" if len(found.angles) > 1 else ""
                    axes.plot(BEARINGS_DEG, values, color=color, label=shown)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        draw_grid(axes)
    every[-1].set_xlabel("bearing (deg)")
    if len(found.angles) > 1:
        figure.legend(
            *every[0].get_legend_handles_labels(),
            loc="outside lower center",
            ncols=len(ELEVATIONS_DEG),
            fontsize=8,
            frameon=False,
        )
    figure.suptitle("What the array can resolve (far source, no echoes)", fontsize=11)
    return figure


def _at_height(found: ArrayResolution, height: float) -> list[PredictedError]:
    return [e for e in found.far if (e.elevation_deg or 0.0) == height]


def _heights(found: ArrayResolution) -> list[float]:
    return list(ELEVATIONS_DEG) if "elevation" in found.angles else []


def _same(found: ArrayResolution) -> str:
    text = _SAME[found.ambiguity]
    shape = found.geometry.known.shape
    if shape.kind == "row" and shape.dimension == 3:
        text = "all directions on a cone around the row have equal delays"
    return text


def _ranges(found: ArrayResolution) -> list[str]:
    if not any(found.farthest_range_m):
        return ["range: not observable with the errors of the array"]
    share = 100.0 * found.geometry.largest_range_error
    lines = [
        f"range std/m by distance (-: more than {share:g} %), and farthest range/m"
    ]
    lines.append(
        "bearing/deg"
        + "".join(f"  {f'{d:g} m':>7}" for d in DISTANCES_M)
        + "  farthest"
    )
    for k, bearing in enumerate(BEARINGS_DEG):
        stds = [e.range_std_m for e in found.near[k :: len(BEARINGS_DEG)]]
        cells = "".join("  " + _number(std, 7, 3) for std in stds)
        farthest = _number(found.farthest_range_m[k], 8, 1)
        lines.append(f"{bearing:11.0f}{cells}  {farthest}")
    return lines


def _better(found: ArrayResolution) -> list[str]:
    columns = (
        ("bearing std/deg", 16),
        ("elevation std/deg", 19),
        ("farthest range/m", 18),
    )
    lines = [f"{'median':<22}" + "".join(f"{name:>{w}}" for name, w in columns)]
    lines += [
        f"{better.change:<22}{_number(better.bearing_std_deg, 16, 3)}"
        f"{_number(better.elevation_std_deg, 19, 3)}"
        f"{_number(better.farthest_range_m, 18, 1)}"
        for better in found.improvements
    ]
    return lines


def _number(value: float | None, width: int, digits: int) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:{width}.{digits}f}"


def _pair(std: float | None, systematic: float | None, width: int) -> str:
    text = "-" if std is None else f"{std:.3f} ({systematic:.3f})"
    return f"{text:>{width}}"
