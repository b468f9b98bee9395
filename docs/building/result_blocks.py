"""The numbers of the pages, from the files in ``docs/results``.

``make results`` writes them anew and names what was out of date. A page marks a table
of results and a number in a sentence by comments, which no reader of the page sees::

    <!-- results: rooms.bursts in rooms -->

    | T60 | range | ... |

    <!-- end -->

    it holds <!-- value: stability.margins | active | phase, deg -->4.6<!-- end --> deg

``rooms`` is the file ``docs/results/rooms.json``, as ``python -m studies rooms --out
docs/results/rooms.json`` writes it: ``tables`` by name, with the command, the seed and
the versions that they come from. A number is a cell of a table, by the first cell of
its row and the heading of its column. ``<!-- lines: NAME.TABLE -->`` is what a program
prints, one line per row; ``<!-- generated: NAME -->`` is a table that the code gives.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from analysis.report.markdown import markdown_table
from analysis.runs.metric_table import GROUPS
from docs.building.reference_tables import columns, commands, metrics, parameters

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs" / "results"

_TABLE = re.compile(
    r"(<!-- results: (\w+)\.(.+?) -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL
)
_LINES = re.compile(
    r"(<!-- lines: (\w+)\.(.+?) -->\n\n```text\n).*?(\n```\n\n<!-- end -->)", re.DOTALL
)
_GENERATED = re.compile(
    r"(<!-- generated: (\w+) -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL
)
_VALUE = re.compile(
    r"(<!-- value: (\w+)\.(.+?) \| (.+?) \| (.+?) -->).*?(<!-- end -->)", re.DOTALL
)


class MissingResultError(LookupError):
    """A page asks for a table or value that no file of results has."""


def pages() -> list[Path]:
    """README and the pages of the documentation."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def filled(text: str) -> str:
    """A page with the blocks and values that the files of results have now.

    Raises:
        MissingResultError: There is no such file, table or cell.
    """
    text = _TABLE.sub(lambda m: m[1] + _table(m[2], m[3]) + m[4], text)
    text = _LINES.sub(lambda m: m[1] + _lines(m[2], m[3]) + m[4], text)
    text = _GENERATED.sub(lambda m: m[1] + _GENERATORS[m[2]]() + m[3], text)
    return _VALUE.sub(lambda m: m[1] + _cell(*m.group(2, 3, 4, 5)) + m[6], text)


def blocks(text: str) -> list[tuple[str, str]]:
    """File and table of each block and number of a page."""
    return [
        (m[2], m[3])
        for pattern in (_TABLE, _LINES, _VALUE)
        for m in pattern.finditer(text)
    ]


def unused() -> list[str]:
    """Files in ``docs/results`` that no page quotes."""
    texts = [page.read_text("utf-8") for page in pages()]
    quoted = {name for text in texts for name, _ in blocks(text)}
    quoted |= {match[2] for text in texts for match in _GENERATED.finditer(text)}
    return sorted({path.stem for path in RESULTS.glob("*.json")} - quoted)


def _table(name: str, table: str) -> str:
    found = _found(name, table)
    return markdown_table(found["columns"], found["rows"])


def _gallery() -> str:
    """A section per scenario."""
    return "\n\n".join(
        f"## {name}\n\n{text[0].upper()}{text[1:]}: {ended}.\n\n`{command}`\n\n"
        f"![{name}](images/gallery/{name}.webp)"
        for name, text, command, ended in _found("gallery", "gallery")["rows"]
    )


def _lines(name: str, table: str) -> str:
    """What a program prints: a table with one column."""
    return "\n".join(row[0] for row in _found(name, table)["rows"])


def _cell(name: str, table: str, row: str, column: str) -> str:
    found = _found(name, table)
    rows = [cells for cells in found["rows"] if cells[0] == row]
    if len(rows) != 1 or column not in found["columns"]:
        raise MissingResultError(
            f"docs/results/{name}.json has {len(rows)} rows {row!r} in its table "
            f"{table!r}, with the columns {', '.join(found['columns'])}; name a cell"
        )
    return str(rows[0][found["columns"].index(column)])


def _found(name: str, table: str) -> dict[str, Any]:
    try:
        tables: dict[str, dict[str, Any]] = _document(name)["tables"]
        return tables[table]
    except (FileNotFoundError, KeyError):
        raise MissingResultError(
            f"docs/results/{name}.json has no table {table!r}; run the study that "
            "gives it with --out, or mend the name"
        ) from None


@cache
def _document(name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text("utf-8"))
    return document


_GENERATORS: dict[str, Callable[[], str]] = {
    "columns": columns,
    "commands": commands,
    "fields": parameters,
    "gallery": _gallery,
    **{f"metrics_{group.name}": partial(metrics, group.name) for group in GROUPS},
}


def main() -> int:
    """Writes the pages anew.

    Returns:
        Exit status: 0, or 1 if a page asks for what is not there, or a file of
        results is in no page.
    """
    for page in pages():
        text = page.read_text("utf-8")
        try:
            new = filled(text)
        except MissingResultError as error:
            print(f"{page.relative_to(ROOT)}: {error}", file=sys.stderr)
            return 1
        if new != text:
            page.write_text(new, "utf-8")
            print(f"{page.relative_to(ROOT)} was out of date")
    left = unused()
    if left:
        print(f"in no page: {', '.join(left)}", file=sys.stderr)
    return int(bool(left))


if __name__ == "__main__":
    sys.exit(main())
