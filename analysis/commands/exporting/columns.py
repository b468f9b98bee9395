"""``phonotaxis columns``: units and meanings of a run's columns or metrics."""

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
    parser.add_argument(
        "--metrics",
        action="store_true",
        help="list the metrics of a run instead of the columns of its table",
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Job[list[Column]]:
    from analysis.runs.columns import COLUMNS, Column
    from systems.framework.input_error import InputError

    kind, known = "column", COLUMNS
    if options.metrics:
        from analysis.runs.metric_table import METRICS

        kind = "metric"
        known = tuple(
            Column(metric.name, metric.unit or "1", metric.meaning)
            for metric in METRICS.values()
        )
    found = [column for column in known if options.pattern in column.name]
    if not found:
        raise InputError(
            "pattern", f"no {kind} has {options.pattern!r} in its name; leave it out"
        )

    def summary(found: list[Column]) -> dict[str, Any]:
        listed = [column._asdict() for column in found]
        return {"schema_version": 1, f"{kind}s": listed}

    def text(found: list[Column], _: dict[str, Any]) -> str:
        name, unit = (max(len(column[k]) for column in found) for k in (0, 1))
        return "\n".join(
            f"{column.name:<{name}}  {column.unit:<{unit}}  {column.meaning}"
            for column in found
        )

    return Job(run=lambda _: found, summary=summary, text=text)


COMMAND = Command(
    "columns",
    "list the units and meanings of a run's columns or metrics",
    _add_arguments,
    _prepare,
    examples=("columns", "columns p_WB", "columns --metrics jerk", "columns --json"),
)
