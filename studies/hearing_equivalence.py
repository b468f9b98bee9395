"""Whether ideal hearing gives the same outcomes as full audio.

``python -m studies hearing_equivalence docs/results/comparisons/hearing.json`` prints
the table of docs/compare.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from analysis.report.intervals import Estimate
from studies.tables import Table

#: Bounds within which both count as equivalent.
RATE, CLEARANCE_M = 0.05, 0.03

_CLEARANCE = "minimum_obstacle_clearance_m"


def equivalent(summary: dict[str, Any]) -> bool:
    """Whether all pairs together differ less than the bounds, intervals included."""
    pair = _pooled(summary)
    clearance = pair["metrics"][_CLEARANCE]["difference"]
    rates = (pair["success"]["difference"], pair["collision"]["difference"])
    return all(r["low"] > -RATE and r["high"] < RATE for r in rates) and (
        clearance["low"] > -CLEARANCE_M and clearance["high"] < CLEARANCE_M
    )


def hearing_table(summary: dict[str, Any]) -> Table:
    """Full audio beside ideal hearing, a row a scenario and law.

    Args:
        summary: JSON document of ``phonotaxis compare --grid
            hearing=[audio,ideal]``.
    """
    headings = (
        "scenario, law",
        "success, audio / ideal",
        "collision, audio / ideal",
        "median clearance, audio / ideal",
        "layouts on which one alone succeeds",
    )
    pairs = [pair for pair in summary["pairs"] if pair["field"] == "hearing"]
    rows = [_row(summary, pair) for pair in pairs]
    pair = _pooled(summary)
    clearance = Estimate(**pair["metrics"][_CLEARANCE]["difference"])
    rates = (
        Estimate(**pair[name]["difference"]).text("+.1f", unit=" points", factor=100.0)
        for name in ("success", "collision")
    )
    rows.append(
        (
            f"all {pair['success']['difference']['n']} pairs, audio less ideal",
            *rates,
            clearance.text("+.2f", unit=" cm", factor=100.0),
            _apart(pair),
        )
    )
    return Table("hearing", headings, rows)


def _pooled(summary: dict[str, Any]) -> dict[str, Any]:
    return next(pair for pair in summary["pooled"] if pair["field"] == "hearing")


def _row(summary: dict[str, Any], pair: dict[str, Any]) -> tuple[str, ...]:
    audio, ideal = (
        next(
            cell
            for cell in summary["cells"]
            if cell["scenario"] == pair["scenario"]
            and cell["fields"] == {**pair["fields"], "hearing": hearing}
        )
        for hearing in (pair["first"], pair["second"])
    )
    rates = (
        f"{100.0 * audio[name]['value']:.1f} % / {100.0 * ideal[name]['value']:.1f} %"
        for name in ("success", "collision")
    )
    clearances = " / ".join(
        f"{100.0 * cell['metrics'][_CLEARANCE]['value']:z.1f}"
        for cell in (audio, ideal)
    )
    law = pair["fields"]["law"]
    return f"{pair['scenario']}, {law}", *rates, f"{clearances} cm", _apart(pair)


def _apart(pair: dict[str, Any]) -> str:
    rate = pair["success"]
    return f"{rate['only_first']} + {rate['only_second']} of {rate['difference']['n']}"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("summary", type=Path, help="of phonotaxis compare, JSON")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield hearing_table(json.loads(options.summary.read_text("utf-8")))
