"""Commands that list scenarios, laws, fields or columns, or check the installation."""

from __future__ import annotations

import json
import shutil
import textwrap
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import take_json
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared

if TYPE_CHECKING:
    from diagrams.scenario.fields.field_list import Field

_SIGNS = {"ok": "ok  ", "note": "note", "bad": "BAD "}


def _scenarios(options: Namespace, take: Take) -> Prepared[Printed]:
    from diagrams import library_scenarios
    from diagrams.scenario.loading import read_mapping

    rows = {
        name: read_mapping(path).get("description", "")
        for name, path in library_scenarios().items()
    }
    return _listing("scenarios", "description", rows)


def _laws(options: Namespace, take: Take) -> Prepared[Printed]:
    from diagrams.scenario.fields.shipped import known_laws

    return _listing("laws", "title", known_laws())


def _listing(plural: str, about: str, rows: Mapping[str, str]) -> Prepared[Printed]:
    """Lists names, each with a line of text; the first two arguments are JSON keys."""
    from analysis.report.provenance import SCHEMA_VERSION

    width = max(map(len, rows))
    text = "\n".join(f"{name:<{width}}  {line}" for name, line in rows.items())
    listed = [{"name": name, about: line} for name, line in rows.items()]
    return _printed({"schema_version": SCHEMA_VERSION, plural: listed}, text)


def _printed(
    document: dict[str, object], text: str, error: Exception | None = None
) -> Prepared[Printed]:
    return Prepared(run=lambda _: Printed(document, text, error))


def _add_fields_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "pattern",
        nargs="?",
        default="",
        help="part of a path or meaning, or a path with * and ? (default: all)",
    )
    parser.add_argument(
        "--schema",
        action="store_true",
        help="print the JSON Schema, for editors and other programs",
    )
    parser.add_argument(
        "--law",
        metavar="NAME",
        help="list only the fields of a robot with this law",
    )
    take_json(parser)


def _fields(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.report.provenance import SCHEMA_VERSION
    from diagrams.scenario.fields.field_list import fields_of_law, find_fields
    from diagrams.scenario.fields.shipped import scenario_schema, schema_text

    schema = scenario_schema()
    found = find_fields(schema, options.pattern)
    if options.law is not None:
        from diagrams.scenario.suggestions import unknown_law
        from systems.laws.catalog import LAWS

        if options.law not in LAWS:
            raise unknown_law(options.law, LAWS)
        found = fields_of_law(found, options.law, LAWS[options.law].robot)
    if options.schema:
        return _printed(schema, schema_text().rstrip("\n"))
    listed = [asdict(field) for field in found]
    return _printed(
        {"schema_version": SCHEMA_VERSION, "fields": listed},
        "\n".join(map(_paragraph, found)),
    )


def _paragraph(field: Field) -> str:
    """Describes a field: a line with path, default, type, and range; the meaning."""
    unit = f" {field.unit}" if field.unit else ""
    has_no_default = field.default is None and field.kind == "group"
    default = "" if has_no_default else f" = {json.dumps(field.default)}{unit}"
    legal = f", {field.range}" if field.range else ""
    width = min(shutil.get_terminal_size().columns, 100)
    meaning = textwrap.fill(
        field.meaning, width, initial_indent="    ", subsequent_indent="    "
    )
    return f"{field.path}{default}  ({field.kind}{legal})\n{meaning}"


def _add_columns_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "pattern", metavar="PATTERN", nargs="?", default="", help="part of a name"
    )
    parser.add_argument(
        "--metrics",
        action="store_true",
        help="list the metrics of a run instead of the columns of its table",
    )
    take_json(parser)


def _columns(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.report.provenance import SCHEMA_VERSION
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
    name, unit = (max(len(column[k]) for column in found) for k in (0, 1))
    text = "\n".join(
        f"{column.name:<{name}}  {column.unit:<{unit}}  {column.meaning}"
        for column in found
    )
    listed = [column._asdict() for column in found]
    return _printed({"schema_version": SCHEMA_VERSION, f"{kind}s": listed}, text)


def _doctor(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.installation import examine
    from analysis.run_error import RunError

    def run(_: object) -> Printed:
        from analysis.report.provenance import SCHEMA_VERSION

        findings = examine()
        bad = [each.name for each in findings if each.verdict == "bad"]
        lines = []
        for each in findings:
            remedy = f"; {each.remedy}" if each.remedy else ""
            lines.append(f"{_SIGNS[each.verdict]} {each.name:<15} {each.found}{remedy}")
        return Printed(
            {
                "schema_version": SCHEMA_VERSION,
                "ok": not bad,
                "findings": [asdict(each) for each in findings],
            },
            "\n".join(lines),
            RunError(f"not ready: {', '.join(bad)}") if bad else None,
        )

    return Prepared(run=run)


SCENARIOS = Command(
    "scenarios",
    "list the library's scenarios",
    take_json,
    _scenarios,
    examples=(
        "scenarios",
        "scenarios --json",
    ),
)
LAWS = Command(
    "laws",
    "list the laws that can be named",
    take_json,
    _laws,
    examples=(
        "laws",
        "laws --json",
    ),
)
FIELDS = Command(
    "fields",
    "list the fields of a scenario: units, defaults, ranges, meanings",
    _add_fields_arguments,
    _fields,
    examples=(
        "fields room",
        "fields 'obstacles.*'",
        "fields --law active",
        "fields reverberation --json",
        "fields --schema > scenario.schema.json",
    ),
)
COLUMNS = Command(
    "columns",
    "list the units and meanings of a run's columns or metrics",
    _add_columns_arguments,
    _columns,
    examples=("columns", "columns p_WB", "columns --metrics jerk", "columns --json"),
)
DOCTOR = Command(
    "doctor",
    "check the installation: packages, compiled code, sound card, browser, disk",
    take_json,
    _doctor,
    examples=("doctor", "doctor --json"),
)
