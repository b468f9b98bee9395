"""The documents name only what exists, and quote the code's own numbers."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from diagrams import Scenario
from docs.tables.columns import column_table
from systems.framework.parameters import Parameters

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
#: A file or folder of ours in code quotes, and what it is to hold.
NAMED_FILE = (
    r"`((?:systems|diagrams|analysis|tests|benchmarks|docs)/[\w./-]*)(?:: (\w+))?`"
)


def text(name: str) -> str:
    return (ROOT / name).read_text("utf-8")


def rows(markdown: str) -> list[list[str]]:
    """Cells of every table row, without headings' rules."""
    table = [line for line in markdown.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table]


def errata() -> dict[str, str]:
    """Place in the papers and tests of each row."""
    return {row[0].lstrip("| "): row[-1] for row in rows(text("docs/errata.md"))[1:]}


def errata_tests() -> set[str]:
    """Names of the functions that test errata."""
    return {
        node.name
        for path in (ROOT / "tests").glob("test_errata_*.py")
        for node in ast.parse(path.read_text("utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    }


def slug(heading: str) -> str:
    """GitHub's anchor of a heading."""
    kept = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return kept.replace(" ", "-")


def alive(path: Path, target: str) -> bool:
    """Whether a relative link's file exists, and its heading."""
    name, _, anchor = target.partition("#")
    file = path.parent / name if name else path
    if not file.exists() or not anchor:
        return file.exists()
    headings = re.findall(r"(?m)^#+ (.*)$", file.read_text("utf-8"))
    return anchor in [slug(heading) for heading in headings]


def fields(parameters: Parameters, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of every field of a tree of parameters."""
    for name in type(parameters).model_fields:
        value = getattr(parameters, name)
        if isinstance(value, Parameters):
            yield from fields(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def as_lists(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [as_lists(item) for item in value]
    return value


def test_every_test_that_errata_names_exists() -> None:
    named = re.findall(r"`(test_\w+)`", text("docs/errata.md"))
    assert len(named) > 30
    assert set(named) <= errata_tests()


def test_every_erratum_test_stands_in_the_table() -> None:
    named = {name for cell in errata().values() for name in cell.strip("`").split("`")}
    assert errata_tests() <= named


def test_every_formula_row_has_a_test() -> None:
    formulas = {place: cell for place, cell in errata().items() if "eq." in place}
    assert len(formulas) > 12
    assert not [place for place, cell in formulas.items() if "`test_" not in cell]


def test_links_lead_somewhere() -> None:
    links = [
        (path, target)
        for path in DOCUMENTS
        for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text("utf-8"))
        if not target.startswith(("http:", "https:", "mailto:"))
    ]
    assert links
    dead = [
        f"{path.name}: {target}" for path, target in links if not alive(path, target)
    ]
    assert not dead


def test_files_that_are_named_exist() -> None:
    """`systems/base/robot.py`, `tests/`, `systems/base/robot.py: RobotParameters`."""
    named = [
        match
        for path in DOCUMENTS
        for match in re.findall(NAMED_FILE, path.read_text("utf-8"))
    ]
    assert named
    missing = [name for name, _ in named if not (ROOT / name).exists()]
    assert not missing
    for name, symbol in named:
        if symbol:
            assert re.search(rf"\b(def|class) {symbol}\b", text(name)), symbol


@pytest.mark.parametrize("name", ["README.md", "docs/exports.md"])
def test_python_of_a_document_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its order, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"(?ms)^```python\n(.*?)^```$", text(name))
    assert blocks
    for block in blocks:
        exec(compile(block, name, "exec"), {})


def test_table_of_columns_is_that_of_the_dictionary() -> None:
    """``python -m docs.tables.columns`` prints it."""
    assert text("docs/exports.md").endswith(column_table())


def test_parameter_table_quotes_the_defaults() -> None:
    """Each field of a scenario has its row: add, mend or drop what is shown."""
    section = text("docs/model.md").partition("## Parameters")[2]
    yaml = YAML(typ="safe")
    quoted = {
        row[0].strip("|` "): yaml.load(row[2].strip("`")) for row in rows(section)[1:]
    }
    assert quoted == {name: as_lists(value) for name, value in fields(Scenario())}


def test_parameter_table_names_units() -> None:
    """A field whose name ends in a unit has one in its row."""
    section = text("docs/model.md").partition("## Parameters")[2]
    bare = [
        row[0]
        for row in rows(section)[1:]
        if re.search(r"_(m|s|m_s|deg|hz|db|pa|kg|n_m|n_s_m)`", row[0])
        and not row[3].strip()
    ]
    assert not bare
