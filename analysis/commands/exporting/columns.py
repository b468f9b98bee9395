"""``phonotaxis columns``: units and meanings of the columns of a run's table."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take

if TYPE_CHECKING:
    from analysis.runs.columns import Column


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "pattern", metavar="PATTERN", nargs="?", default="", help="part of a name"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[list[Column]]:
    from analysis.runs.columns import COLUMNS
    from systems.framework.input_error import InputError

    found = [column for column in COLUMNS if options.pattern in column.name]
    if not found:
        raise InputError(
            "pattern", f"no column has {options.pattern!r} in its name; leave it out"
        )

    def summary(found: list[Column]) -> dict[str, Any]:
        listed = [column._asdict() for column in found]
        return {"schema_version": 1, "columns": listed}

    def text(found: list[Column], _: dict[str, Any]) -> str:
        name, unit = (max(len(column[k]) for column in found) for k in (0, 1))
        return "\n".join(
            f"{column.name:<{name}}  {column.unit:<{unit}}  {column.meaning}"
            for column in found
        )

    return Job(run=lambda _: found, summary=summary, text=text)


COMMAND = Command(
    "columns",
    "list the units and meanings of a run's columns",
    _add_arguments,
    _prepare,
    examples=("columns", "columns p_WB", "columns --json"),
)
