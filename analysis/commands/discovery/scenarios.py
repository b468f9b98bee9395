"""``phonotaxis scenarios``: the library's scenarios."""

from __future__ import annotations

from argparse import Namespace

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.discovery.listing import listing


def _prepare(options: Namespace, take: Take) -> Job[dict[str, str]]:
    from diagrams import library_scenarios
    from diagrams.scenario.loading import read_mapping

    return listing(
        "scenarios",
        "description",
        lambda: {
            name: read_mapping(path).get("description", "")
            for name, path in library_scenarios().items()
        },
    )


COMMAND = Command(
    "scenarios",
    "list the library's scenarios",
    take_json,
    _prepare,
    examples=(
        "scenarios",
        "scenarios --json",
    ),
)
