"""Formats sounds that were located from delays, and draws them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from analysis.arrays.cramer_rao import polar_point
from analysis.arrays.delay_places import DelayEstimate, DelayPlaces
from analysis.report.palette import COLORS, draw_grid
from analysis.report.plain_values import plain
from analysis.report.provenance import SCHEMA_VERSION

_COLUMNS = (
    ("bearing_deg", "bearing/deg", 11, 2),
    ("bearing_std_deg", "std", 7, 3),
    ("elevation_deg", "elevation/deg", 13, 2),
    ("elevation_std_deg", "std", 7, 3),
    ("range_m", "range/m", 8, 3),
    ("range_std_m", "std", 7, 3),
)


def delays_document(places: DelayPlaces) -> dict[str, Any]:
    """Builds the JSON document of ``phonotaxis.locate_delays``."""
    known = places.geometry.known
    shape = known.shape
    return {
        "schema_version": SCHEMA_VERSION,
        "array": {
            "microphones": [list(place) for place in places.geometry.microphones],
            "kind": shape.kind,
            "aperture_m": shape.aperture_m,
            "side": shape.side,
            "ambiguity": shape.ambiguity,
            "sound_speed_m_s": known.c,
            "sound_speed_std_m_s": known.budget.speed_std,
            "position_std_m": known.budget.position_std,
            "delay_std_s": known.budget.delay_std,
            "largest_range_error": known.largest_range_error,
        },
        "arrival_std_s": places.arrival_std_s,
        "estimates": [plain(estimate) for estimate in places.estimates],
    }


def delays_text(places: DelayPlaces) -> str:
    """Formats one row per sound for a terminal."""
    count = len(places.estimates)
    found = sum(not e.reason for e in places.estimates)
    lines = [f"located {found} of {count} sounds"]
    if places.arrival_std_s is not None:
        lines.append(
            "standard deviation of an arrival time, from the misfit: "
            f"{1e6 * places.arrival_std_s:.3g} us"
        )
    head = "".join(f"  {name:>{width}}" for _, name, width, _ in _COLUMNS)
    lines += ["", f"sound{head}"]
    for k, estimate in enumerate(places.estimates):
        lines += [f"{k + 1:5d}{_row(estimate)}"]
        lines += [f"   or{_row(other)}" for other in estimate.alternatives]
    return "\n".join(lines)


def delays_notes(places: DelayPlaces) -> list[str]:
    """Lists what is wrong with the delays, one line per sound."""
    notes = []
    for k, estimate in enumerate(places.estimates):
        name = f"sound {k + 1}"
        if estimate.reason:
            notes.append(f"{name}: {estimate.reason}")
            continue
        if estimate.left_out:
            listed = ", ".join(str(m + 1) for m in estimate.left_out)
            notes.append(
                f"{name}: without microphone {listed}, whose delays are missing or "
                "longer than sound can travel"
            )
        if estimate.error_scale > 1.0:
            notes.append(
                f"{name}: no place explains the delays within their errors; the "
                f"errors are taken to be {estimate.error_scale:.1f} times as large"
            )
    return notes


def plot_delays(places: DelayPlaces) -> Figure:
    """Draws the microphones, and the directions or positions, from above."""
    p = np.array(places.geometry.microphones)[:, :2]
    middle = p.mean(axis=0)
    found = [e for e in places.estimates if e.direction is not None]
    ranges = [e.range_m for e in found if e.range_m is not None]
    size = max(1.6 * float(np.abs(p - middle).max()), 1.15 * max(ranges, default=0.0))
    figure = Figure(figsize=(5.5, 5.5), layout="constrained")
    axes = figure.subplots()
    for estimate in found:
        if estimate.position_m is not None:
            end = np.array(estimate.position_m[:2])
            axes.plot(*end, "x", color=COLORS["estimate"])
        elif estimate.bearing_deg is not None:
            end = middle + polar_point(0.95 * size, estimate.bearing_deg)
        else:
            continue
        axes.plot(*np.stack((middle, end), axis=1), color=COLORS["estimate"], alpha=0.4)
    axes.plot(*p.T, "o", color=COLORS["robot"], markersize=4, label="microphones")
    draw_grid(axes)
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title("Located sounds from above", fontsize=10)
    axes.legend(fontsize=8)
    return figure


def _row(estimate: Any) -> str:
    row = ""
    for name, _, width, digits in _COLUMNS:
        value = getattr(estimate, name, None)
        row += f"  {'-':>{width}}" if value is None else f"  {value:{width}.{digits}f}"
    return row + (
        f"  {estimate.reason}"
        if isinstance(estimate, DelayEstimate) and estimate.reason
        else ""
    )
