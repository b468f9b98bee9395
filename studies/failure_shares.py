"""How often each mechanism was behind a failure.

``python -m studies failure_shares docs/results/comparisons/laws.json`` prints the
table of docs/results_laws.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from studies.tables import Table

MECHANISMS = (
    "no echo",
    "out of sight",
    "late echo",
    "echo in time",
    "jam",
    "held off",
    "swings",
    "lost",
    "astray",
    "diverged",
    "no way found",
    "failed",
)


def failure_table(summary: dict[str, Any]) -> Table:
    """Shares of all layouts, the commonest failure of a row in bold.

    Args:
        summary: JSON document of ``phonotaxis compare``. Scenarios in which
            nothing failed are left out, and mechanisms that none failed by.
    """
    found = [cell["mechanisms"] for cell in summary["cells"]]
    names = [name for name in MECHANISMS if any(counts.get(name) for counts in found)]
    rows = []
    for cell in summary["cells"]:
        counts, runs = cell["mechanisms"], cell["runs"]
        failures = sum(counts.values())
        if failures == 0:
            continue
        shares = [_share(counts, name, runs) for name in names]
        failed = f"{100.0 * failures / runs:.1f} %"
        rows.append([cell["scenario"], cell["fields"]["law"], failed, *shares])
    return Table("failures", ["scenario", "law", "failures", *names], rows)


def _share(counts: dict[str, int], name: str, runs: int) -> str:
    share = f"{100.0 * counts.get(name, 0) / runs:.1f} %"
    return f"**{share}**" if counts.get(name) == max(counts.values()) else share


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("summary", type=Path, help="of phonotaxis compare, JSON")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    yield failure_table(json.loads(options.summary.read_text("utf-8")))
