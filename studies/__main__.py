"""Runs a study: ``python -m studies NAME [options] [--out FILE.json]``.

Without a name it lists the studies. A study is a module of this folder with

- ``add_options(parser)``, which adds its options to an ``argparse`` parser;
- ``SEED``, if one seed decides all that it draws and is no option;
- ``run(options)``, which yields ``Table`` objects, and raises ``MissedBoundError`` at
  the end if a result is worse than it may be (exit status 1).

The tables are printed in Markdown; ``--out`` writes them as JSON, too, with the
command, the versions of the libraries and the seed.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from shlex import join
from typing import Any

from analysis.report.markdown import markdown_head, markdown_row
from analysis.report.plain_values import plain, write_json
from analysis.report.provenance import versions
from studies.tables import MissedBoundError, Table
from systems.framework.input_error import InputError

_NO_STUDIES = ("__init__", "__main__", "tables")


def studies() -> dict[str, str]:
    """First line of each study's docstring by the study's name."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return {
        file.stem: (
            ast.get_docstring(ast.parse(file.read_text("utf-8"))) or ""
        ).partition("\n")[0]
        for file in files
        if file.stem not in _NO_STUDIES
    }


def main(words: Sequence[str]) -> int:
    """Runs a study or lists them.

    Args:
        words: Of the command line, without the program's name.

    Returns:
        Exit status: 0 done, 1 a bound is missed, 2 there is no such study.
    """
    known = studies()
    if not words or words[0] in ("-h", "--help"):
        width = max(map(len, known))
        print(*(f"{name:<{width}}  {line}" for name, line in known.items()), sep="\n")
        return 0
    name = words[0]
    if name not in known:
        print(f"no study is called {name}; see python -m studies", file=sys.stderr)
        return 2
    study: Any = import_module(f"studies.{name}")
    parser = argparse.ArgumentParser(
        prog=f"python -m studies {name}",
        description=study.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    study.add_options(parser)
    parser.add_argument(
        "--out", metavar="FILE.json", type=Path, help="write the tables as JSON, too"
    )
    options = parser.parse_args(words[1:])
    tables, missed = {}, ""
    try:
        for table in study.run(options):
            tables[table.name] = _shown(table)
    except MissedBoundError as error:
        missed = str(error)
        print(f"MISSED: {missed}")
    except InputError as error:
        parser.error(str(error))
    if options.out is not None:
        document = {
            "command": join(["python", "-m", "studies", *words]),
            "seed": getattr(options, "seed", getattr(study, "SEED", None)),
            "versions": versions(),
            "missed": missed,
            "tables": tables,
        }
        write_json(plain(document), options.out)
    return int(bool(missed))


def _shown(table: Table) -> dict[str, Any]:
    """Prints a table row by row, and returns what JSON holds of it."""
    print(f"{table.name}:\n\n{markdown_head(table.columns)}", flush=True)
    rows = []
    for row in table.rows:
        print(markdown_row(row), flush=True)
        rows.append(list(row))
    print()
    return {"columns": list(table.columns), "rows": rows}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
