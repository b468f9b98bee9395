"""The papers' claims, held against the summary of a comparison.

``python -m studies claims laws.json following.json slip.json``, with the files of
``docs/results/comparisons``, prints the table of docs/results_laws.md.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.support.claim_judges import (
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
from studies.tables import Table


@dataclass(frozen=True)
class Claim:
    """What a paper says, and how our figures bear on it."""

    text: str
    source: str
    judge: Judge


def claims_table(summaries: Sequence[dict[str, Any]]) -> Table:
    """The table: claim, source, our figure, verdict.

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
    return Table("claims", ("claim", "source", "our figure", "verdict"), rows)


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


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument(
        "summaries", nargs="+", type=Path, help="of phonotaxis compare, JSON"
    )


def run(options: argparse.Namespace) -> Iterator[Table]:
    """The table."""
    documents = [json.loads(file.read_text("utf-8")) for file in options.summaries]
    yield claims_table(documents)
