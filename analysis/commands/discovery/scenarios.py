"""``phonotaxis scenarios``: the library's scenarios."""

from __future__ import annotations

from argparse import Namespace

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take
from analysis.commands.discovery.listing import listing

__all__ = ["COMMAND"]


def _prepare(options: Namespace, take: Take) -> Job[dict[str, str]]:
    from diagrams import library_scenarios, load_scenario

    return listing(
        "scenarios",
        "description",
        lambda: {name: load_scenario(name).description for name in library_scenarios()},
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
