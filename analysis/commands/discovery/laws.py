"""``phonotaxis laws``: the laws that come with the package."""

from __future__ import annotations

from argparse import Namespace

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.discovery.listing import listing


def _prepare(options: Namespace, take: Take) -> Job[dict[str, str]]:
    from diagrams.scenario.fields.shipped import known_laws

    return listing("laws", "title", known_laws)


COMMAND = Command(
    "laws",
    "list the laws that can be named",
    take_json,
    _prepare,
    examples=(
        "laws",
        "laws --json",
    ),
)
