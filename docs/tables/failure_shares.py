"""How often each mechanism was behind a failure, as a table.

``python -m docs.tables.failure_shares docs/results/laws.json`` prints the table of
docs/failures.md.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from analysis.reporting.markdown import markdown_table

__all__ = ["failure_table"]

MECHANISMS = (
    "never heard",
    "out of sight",
    "heard late",
    "pushed too little",
    "jam",
    "held off",
    "swings",
    "lost",
    "astray",
    "diverged",
    "no way found",
    "failed",
)


def failure_table(summary: dict[str, Any]) -> str:
    """Shares of all layouts in Markdown, the commonest failure of a row in bold.

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
        rows.append([cell["scenario"], cell["law"], failed, *shares])
    return markdown_table(["scenario", "law", "failures", *names], rows)


def _share(counts: dict[str, int], name: str, runs: int) -> str:
    share = f"{100.0 * counts.get(name, 0) / runs:.1f} %"
    return f"**{share}**" if counts.get(name) == max(counts.values()) else share


if __name__ == "__main__":
    document = json.loads(Path(sys.argv[1]).read_text("utf-8"))
    sys.stdout.write(failure_table(document) + "\n")
