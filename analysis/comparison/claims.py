"""The papers' claims, held against the summary of a comparison.

``python -m analysis.comparison.claims docs/results/laws.json
docs/results/following.json docs/results/slip.json`` prints the table of docs/claims.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.comparison.claim_judges import (
    ONE,
    STATIC,
    TWO,
    Judge,
    accurate,
    avoids_more,
    blind,
    collision_free,
    earlier,
    follows,
    jams,
    slips_less,
    smoother,
    vibrates,
)
from analysis.reporting.markdown import markdown_table

__all__ = ["CLAIMS", "Claim", "claims_table"]


@dataclass(frozen=True)
class Claim:
    """What a paper says, and how our figures bear on it."""

    text: str
    source: str
    judge: Judge


def claims_table(summaries: Sequence[dict[str, Any]]) -> str:
    """The table in Markdown: claim, source, our figure, verdict.

    Args:
        summaries: JSON documents of ``phonotaxis compare`` that hold, together,
            the papers' experiments with obstacles with the papers' laws, and
            ``obstacle_free`` with active; and ``two_static_obstacles`` with ``--grid
            plant.friction=[...]``.
    """
    summary = {
        part: [entry for document in summaries for entry in document[part]]
        for part in ("cells", "pairs")
    }
    rows = []
    for claim in CLAIMS:
        figure, verdict = claim.judge(summary)
        rows.append((claim.text, claim.source, figure, f"**{verdict}**"))
    return markdown_table(("claim", "source", "our figure", "verdict"), rows)


#: What the papers say of their laws, each with who judges it by figures of ours.
CLAIMS = (
    Claim("The robot tracks the moving source", "Han 5.1, figure 11", follows),
    Claim(
        "Active: collision-free among two static obstacles",
        "Han 5.2, figure 13",
        collision_free(STATIC),
    ),
    Claim(
        "Active avoids static obstacles better than conventional",
        "Han 5.2, figure 13",
        avoids_more(STATIC, "active"),
    ),
    Claim(
        "Active: smoother trajectory than conventional",
        "Han 5.2, figure 13",
        smoother(STATIC),
    ),
    Claim("Active: less slippage than conventional", "Han 3.3, 5.2, 6", slips_less),
    Claim(
        "Active: a more accurate trajectory, for less slippage", "Han 5.2, 6", accurate
    ),
    Claim("Active reacts earlier, to far obstacles", "Han 3.3, 5.2", earlier),
    Claim(
        "Among several obstacles conventional jams, active does not",
        "Han 3.2, 3.3",
        jams,
    ),
    Claim(
        "Active: follows past a moving obstacle without collision",
        "Han 5.3, figure 15",
        collision_free(ONE),
    ),
    Claim(
        "Conventional collides with a moving obstacle where active does not",
        "Han 5.3, figure 15c",
        avoids_more(ONE, "active"),
    ),
    Claim(
        "Active: follows past two moving obstacles without collision",
        "Han 5.3, figure 16",
        collision_free(TWO),
    ),
    Claim(
        "Conventional collides with two moving obstacles where active does not",
        "Han 5.3, figure 16c",
        avoids_more(TWO, "active"),
    ),
    Claim(
        "Sudden pushes of a moving obstacle make conventional vibrate",
        "Han 3.2",
        vibrates,
    ),
    Claim(
        "Kim's active law avoids static obstacles better than his conventional one",
        "Kim 5, experiment 2",
        avoids_more(STATIC, "active2017", baseline="conventional2017"),
    ),
    Claim("Obstacles from all sides need more sensors", "Han 6", blind),
)


if __name__ == "__main__":
    documents = [json.loads(Path(name).read_text("utf-8")) for name in sys.argv[1:]]
    sys.stdout.write(claims_table(documents) + "\n")
