"""Commands that list scenarios, laws, fields, columns, results, the installation."""

from __future__ import annotations

import html
import json
import re
import shutil
import textwrap
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from phonotaxis.commands.arguments import (
    LAW_WORDS,
    SCENARIO_WORDS,
    completed_by,
    take_json,
    take_laws,
)
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.result import Prepared

if TYPE_CHECKING:
    from diagrams.scenario.fields.field_list import Field
    from phonotaxis.listings import Listing

_SIGNS = {"ok": "ok  ", "note": "note", "bad": "BAD "}


def _add_scenarios_arguments(parser: ArgumentParser) -> None:
    name = parser.add_argument(
        "name",
        nargs="?",
        help="print this scenario: a name, a YAML file or a result directory",
    )
    completed_by(name, SCENARIO_WORDS)
    parser.add_argument(
        "--copy",
        metavar="FILE",
        help="write the named scenario to a new file, to change it",
    )
    take_json(parser)


def _scenarios(options: Namespace, take: Take) -> Prepared[Printed]:
    from phonotaxis.listings import scenarios

    if options.name is not None or options.copy is not None:
        return _scenario(options.name, options.copy)
    return _listing("scenarios", "description", scenarios())


def _scenario(name: str | None, copy: str | None) -> Prepared[Printed]:
    """Prints or copies the file of one scenario."""
    from analysis.report.provenance import SCHEMA_VERSION
    from diagrams.scenario.loading import load_scenario, scenario_text
    from systems.framework.input_error import InputError

    if name is None:
        raise InputError(
            "name", f"is missing; write phonotaxis scenarios default --copy {copy}"
        )
    load_scenario(name)  # refuses faults of a user's file
    # The schema lies elsewhere for a copy.
    text = re.sub(r"^# yaml-language-server.*\n", "", scenario_text(name))
    document = {"schema_version": SCHEMA_VERSION, "scenario": name, "text": text}
    if copy is None:
        return _printed(document, text.rstrip("\n"))
    path = Path(copy)
    if path.suffix not in (".yaml", ".yml"):
        raise InputError("copy", f"{copy} must end in .yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise InputError(
            "copy", f"{copy} cannot be written ({error.strerror}); name a new file"
        ) from None
    return _printed(
        {**document, "file": copy}, f"wrote {copy}; phonotaxis simulate {copy} runs it"
    )


def _add_laws_arguments(parser: ArgumentParser) -> None:
    name = parser.add_argument("name", nargs="?", help="describe this law, with fields")
    completed_by(name, LAW_WORDS)
    take_json(parser)


def _laws(options: Namespace, take: Take) -> Prepared[Printed]:
    from phonotaxis.listings import laws

    if options.name is not None:
        return _law(options.name, laws())
    return _listing("laws", "title", laws())


def _law(name: str, titles: Mapping[str, str]) -> Prepared[Printed]:
    """Prints the title of a law and the fields that only robots with this law use."""
    from analysis.report.provenance import SCHEMA_VERSION
    from diagrams.scenario.fields.field_list import list_fields
    from diagrams.scenario.fields.shipped import scenario_schema
    from diagrams.scenario.suggestions import unknown_law
    from systems.framework.input_error import InputError

    if name not in titles:
        raise InputError("name", unknown_law(name, titles).message)
    fields = [
        field
        for field in list_fields(scenario_schema())
        if field.path.startswith(f"laws.{name}.")
    ]
    document = {
        "schema_version": SCHEMA_VERSION,
        "name": name,
        "title": titles[name],
        "fields": [asdict(field) for field in fields],
    }
    more = f"phonotaxis fields --law {name} lists all fields of a robot with this law"
    return _printed(document, "\n".join([titles[name], *map(_paragraph, fields), more]))


def _results(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.report.provenance import SCHEMA_VERSION
    from analysis.report.result_directory import RESULTS, numbered_results

    given = options.directories
    paths = [each for path in given for each in _results_in(path)]
    paths = paths if given else numbered_results()
    rows = [(str(path), _changed(path), _title(path)) for path in paths]
    listed = [{"out": out, "time": at, "title": title} for out, at, title in rows]
    text = "\n".join("  ".join(row) for row in rows)
    return _printed(
        {"schema_version": SCHEMA_VERSION, "results": listed},
        text or f"no results under {RESULTS}/; 'phonotaxis simulate' writes some",
    )


def _add_results_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "directories",
        metavar="DIR",
        nargs="*",
        help="list these result directories, or those in these folders (default: "
        "results)",
    )
    take_json(parser)


def _results_in(given: str) -> list[Path]:
    """Returns a result directory itself, or the result directories in a folder."""
    from analysis.report.result_directory import RESULTS
    from systems.framework.input_error import InputError

    path = Path(given).expanduser()
    for each in (path, Path(RESULTS) / path):
        if _is_result(each):
            return [each]
    found = sorted(each for each in path.glob("*/") if _is_result(each))
    if not found:
        remedy = "give a directory that --out of another command has named"
        if given.isdecimal():
            remedy = f"the page of a result is {RESULTS}/{given}/report.html"
        raise InputError("dir", f"{given!r} has no results; {remedy}")
    return found


def _is_result(path: Path) -> bool:
    return any((path / name).is_file() for name in ("summary.json", "report.html"))


def _changed(path: Path) -> str:
    local = datetime.fromtimestamp(path.stat().st_mtime, UTC).astimezone()
    return local.strftime("%Y-%m-%d %H:%M")


def _title(path: Path) -> str:
    """Returns the title of the page in a result directory, or its first file's name."""
    page = path / "report.html"
    try:
        with page.open(encoding="utf-8") as file:
            found = re.search(r"<title>(.*?)</title>", file.read(2_000))
    except OSError:
        found = None
    if found:
        return html.unescape(found[1])
    names = sorted(each.name for each in path.iterdir())
    return ", ".join(names[:3]) or "empty"


def _listing(plural: str, about: str, rows: Listing) -> Prepared[Printed]:
    """Lists names, each with one line of text; the words are keys of the document."""
    from analysis.report.provenance import SCHEMA_VERSION

    listed = [{"name": name, about: line} for name, line in rows.items()]
    return _printed({"schema_version": SCHEMA_VERSION, plural: listed}, repr(rows))


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
    take_laws(parser, "lists only the fields of robots with these laws")
    take_json(parser)


def _fields(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.report.provenance import SCHEMA_VERSION
    from diagrams.scenario.fields.field_list import find_fields
    from diagrams.scenario.fields.shipped import scenario_schema, schema_text

    schema = scenario_schema()
    own = _own_gains(options.law or [])
    found = find_fields(schema, options.pattern, own)
    if options.law:
        found = _of_laws(options.law, found)
    if options.schema:
        return _printed(schema, schema_text().rstrip("\n"))
    listed = [asdict(field) for field in found]
    return _printed(
        {"schema_version": SCHEMA_VERSION, "fields": listed},
        "\n".join(map(_paragraph, found)),
    )


def _of_laws(given: list[str], fields: list[Field]) -> list[Field]:
    """Returns the fields of robots that have one of the laws."""
    from diagrams.scenario.fields.field_list import fields_of_law
    from diagrams.scenario.suggestions import law_names, unknown_law
    from systems.framework.input_error import InputError
    from systems.laws.catalog import LAWS

    names = law_names(given)
    names = [*LAWS] if "all" in names else names
    for law in names:
        if law not in LAWS and ":" not in law:
            raise InputError("law", unknown_law(law, LAWS).message)
    kinds = {law: LAWS[law].robot if law in LAWS else "follower" for law in names}
    own = [fields_of_law(fields, law, kind) for law, kind in kinds.items()]
    return [field for field in fields if any(field in each for each in own)]


def _own_gains(given: list[str]) -> list[Field]:
    """Returns the gains of the user's own laws as fields."""
    from diagrams.scenario.suggestions import law_names

    laws = [law for law in law_names(given) if ":" in law] if given else []
    if not laws:
        return []
    from diagrams.scenario.own_gains import gain_fields

    return [field for law in laws for field in gain_fields(law)]


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
    "list the library's scenarios, or print or copy one",
    _add_scenarios_arguments,
    _scenarios,
    examples=(
        "scenarios",
        "scenarios u_trap",
        "scenarios u_trap --copy my_scenario.yaml",
    ),
    synonyms=("list", "show", "scenario"),
)
LAWS = Command(
    "laws",
    "list the laws that can be named, or describe one",
    _add_laws_arguments,
    _laws,
    examples=(
        "laws",
        "laws active",
    ),
    synonyms=("law",),
)
RESULTS = Command(
    "results",
    "list result directories: those under results/, or those given",
    _add_results_arguments,
    _results,
    examples=("results", "results my_runs/wall my_runs"),
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
        "fields --law my_laws.py:soft own_gains",
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
