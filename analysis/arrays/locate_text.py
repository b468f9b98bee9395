"""Describes a located source in text for a terminal."""

from __future__ import annotations

from typing import Any

from analysis.arrays.locate_result import LocatedSource
from analysis.arrays.source_estimate import SourceEstimate

_WHY_NOTHING = (
    "; the recording is silent or noise, or the positions (in m) or the speed of "
    "sound do not match the array, or the source is within 0.2 m of its center"
)

#: Largest number of rows of the table, so that the summary stays on the screen.
_MOST_ROWS = 10
_COLUMNS = (
    ("bearing_deg", "bearing/deg", 11, 2),
    ("bearing_std_deg", "std", 7, 3),
    ("elevation_deg", "elevation/deg", 13, 1),
    ("elevation_std_deg", "std", 6, 2),
    ("range_m", "range/m", 8, 3),
    ("range_std_m", "std", 7, 3),
)


def locate_text(result: LocatedSource) -> str:
    """Describes a result by a summary and a table of estimates.

    The summary is first. If there are many estimates, the rows are evenly spaced.
    """
    heard = f"heard a source in {len(result.estimates)} of {result.frames} frames"
    if not result.estimates and not result.agreed.sources:
        why = [f"; {f.message}" for f in result.faults if f.kind == "tone"]
        return f"{heard}: nothing to locate{''.join(why) or _WHY_NOTHING}"
    lines = [heard, *_direction(result), _range(result), *_sources(result)]
    lines.append("")
    lines.append("    t/s" + "".join(f"  {name:>{w}}" for _, name, w, _ in _COLUMNS))
    estimates = result.estimates
    shown = [
        estimates[k * (len(estimates) - 1) // (_MOST_ROWS - 1)]
        for k in range(_MOST_ROWS if len(estimates) > _MOST_ROWS else 0)
    ]
    lines += [_row(estimate) for estimate in shown or estimates]
    if shown:
        lines.append(
            f"{len(shown)} of {len(estimates)} estimates; --json prints all of them, "
            "and --out DIR writes them to locate.json"
        )
    return "\n".join(lines)


def _direction(result: LocatedSource) -> list[str]:
    summary = result.main_source()
    parts = []
    if summary["bearing_deg"] is not None:
        parts.append(
            f"bearing {summary['bearing_deg']:.2f} deg (std "
            f"{summary['bearing_std_deg']:.2f}{_of_array(summary)})"
        )
    if summary["elevation_deg"] is not None:
        parts.append(
            f"elevation {summary['elevation_deg']:.1f} deg "
            f"(std {summary['elevation_std_deg']:.1f})"
        )
    lines = [
        ", ".join(parts)
        or "direction not observable: the row of microphones is slanted"
    ]
    for other in summary["alternatives"]:
        text = f"or bearing {other['bearing_deg']:.2f} deg"
        if other["elevation_deg"] is not None:
            text += f", elevation {other['elevation_deg']:.1f} deg"
        cause = "a row" if summary["ambiguity"] == "front_back" else "a plane"
        lines.append(f"{text}: {cause} of microphones cannot distinguish them")
    if summary["elevation_deg"] is None:
        lines.append("elevation not observable with this array")
    return lines


def _of_array(summary: dict[str, Any]) -> str:
    part = summary["bearing_systematic_deg"]
    return "" if part is None else f", of which {part:.2f} from errors of array and air"


def _range(result: LocatedSource) -> str:
    summary = result.main_source()
    if not summary["frames_of_main_source"]:
        return "no frame gives its place; its direction is that of single frequencies"
    ranges = [e.range_m for e in result.estimates if e.range_m is not None]
    if summary["range_m"] is None and ranges:
        return (
            f"no single range: {len(ranges)} of {len(result.estimates)} estimates have "
            f"one, from {min(ranges):.3f} to {max(ranges):.3f} m"
        )
    if summary["range_m"] is None:
        size = 100.0 * result.shape.aperture_m
        return f"range not observable (microphones within {size:.1f} cm)"
    return (
        f"range {summary['range_m']:.3f} m (std {summary['range_std_m']:.3f}, of "
        f"which {summary['range_systematic_m']:.3f} from errors of array and air, "
        "equal in all)"
    )


def _sources(result: LocatedSource) -> list[str]:
    sources, doubt = result.agreed.sources, result.agreed.doubt
    lines = [] if doubt is None else [f"{doubt}: the number of sources is unknown"]
    if len(sources) < 2:
        return lines
    listed = "directions" if doubt else "sources"
    lines.append(f"{len(sources)} {listed}; the lines above describe the main source")
    lines += [
        f"  bearing {source.bearing_deg:7.1f} deg, {100.0 * source.share:3.0f} % of "
        f"what is heard, confidence {source.confidence:.2f}"
        for source in sources
    ]
    return lines


def _row(estimate: SourceEstimate) -> str:
    row = f"{estimate.t_s:7.3f}"
    for name, _, width, digits in _COLUMNS:
        value = getattr(estimate, name)
        row += f"  {'-':>{width}}" if value is None else f"  {value:{width}.{digits}f}"
    return row
