"""``phonotaxis fields``: every field of a scenario."""

from __future__ import annotations

import json
import shutil
import textwrap
from argparse import ArgumentParser, Namespace
from dataclasses import asdict
from typing import TYPE_CHECKING

from analysis.commands.arguments import take_json
from analysis.commands.command import Command, Job, Take

if TYPE_CHECKING:
    from diagrams.scenario.fields.field_list import Field


def _add_arguments(parser: ArgumentParser) -> None:
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


def _prepare(options: Namespace, take: Take) -> Job[list[Field]]:
    from diagrams.scenario.fields.field_list import fields_of_law, find_fields
    from diagrams.scenario.fields.shipped import scenario_schema, schema_text

    schema = scenario_schema()
    found = find_fields(schema, options.pattern)
    if options.law is not None:
        from diagrams.scenario.suggestions import unknown_law
        from systems.laws.catalogue import LAWS

        if options.law not in LAWS:
            raise unknown_law(options.law, LAWS)
        found = fields_of_law(found, options.law, LAWS[options.law].robot)
    if options.schema:
        return Job(
            run=lambda _: found,
            summary=lambda _: schema,
            text=lambda *_: schema_text().rstrip("\n"),
        )
    return Job(
        run=lambda _: found,
        summary=lambda fields: {
            "schema_version": 1,
            "fields": [asdict(field) for field in fields],
        },
        text=lambda fields, _: "\n".join(map(_paragraph, fields)),
    )


def _paragraph(field: Field) -> str:
    """Describes a field: a line with the values for ``--set``, then the meaning."""
    unit = f" {field.unit}" if field.unit else ""
    default = "" if _has_no_default(field) else f" = {json.dumps(field.default)}{unit}"
    legal = f", {field.range}" if field.range else ""
    width = min(shutil.get_terminal_size().columns, 100)
    meaning = textwrap.fill(
        field.meaning, width, initial_indent="    ", subsequent_indent="    "
    )
    return f"{field.path}{default}  ({field.kind}{legal})\n{meaning}"


def _has_no_default(field: Field) -> bool:
    return field.default is None and field.kind == "group"


COMMAND = Command(
    "fields",
    "list the fields of a scenario: units, defaults, ranges, meanings",
    _add_arguments,
    _prepare,
    examples=(
        "fields room",
        "fields 'obstacles.*'",
        "fields --law active",
        "fields reverberation --json",
        "fields --schema > scenario.schema.json",
    ),
)
