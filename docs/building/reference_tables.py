"""What the code itself gives: columns of a run, fields of a scenario, commands."""

from __future__ import annotations

import json
from argparse import RawDescriptionHelpFormatter
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from analysis.report.markdown import markdown_table
from analysis.runs.columns import COLUMNS
from analysis.runs.metric_table import GROUPS
from diagrams.scenario.fields.field_list import list_fields
from diagrams.scenario.fields.shipped import scenario_schema
from phonotaxis.commands.command_line import make_parser

#: Symbol in the equations and place in the papers, by field.
_SOURCES = Path(__file__).with_name("parameter_sources.json")


def columns() -> str:
    """One row per column of a run's table."""
    rows = ((f"`{each.name}`", each.unit, each.meaning) for each in COLUMNS)
    return markdown_table(("column", "unit", "meaning"), rows)


def metrics(group: str) -> str:
    """One row per metric of a group: name, unit, averaging, and definition."""
    rows = (
        (f"`{m.name}`", m.unit or "1", m.average, m.of, m.robots, m.meaning)
        for each in GROUPS
        if each.name == group
        for m in each.metrics
    )
    head = ("metric", "unit", "average", "of runs", "of robots", "definition")
    return markdown_table(head, rows)


def parameters() -> str:
    """One row per field of a scenario.

    Raises:
        KeyError: ``parameter_sources.json`` names a field that does not exist.
    """
    sources: dict[str, dict[str, str]] = json.loads(_SOURCES.read_text("utf-8"))

    def rows() -> Iterator[tuple[str, ...]]:
        for field in list_fields(scenario_schema()):
            said = sources.pop(field.path, {"symbol": "", "source": ""})
            default = "" if field.default is None else f"`{json.dumps(field.default)}`"
            meaning = " ".join(field.meaning.split()).replace("|", "\\|")
            cells = (said["symbol"], default, field.unit, meaning, said["source"])
            yield (f"`{field.path}`", *cells)

    head = ("field", "symbol", "default", "unit", "meaning", "printed in")
    table = markdown_table(head, rows())
    if sources:
        raise KeyError(f"{_SOURCES.name}: no such fields: {', '.join(sources)}")
    return table


def commands() -> str:
    """One section per command, with its help."""
    parts = []
    for name, parser in make_parser().below.items():
        # As wide as a page, whatever the terminal.
        parser.formatter_class = partial(RawDescriptionHelpFormatter, width=90)
        parts.append(f"## {name}\n\n```text\n{parser.format_help().rstrip()}\n```")
    return "\n\n".join(parts)
