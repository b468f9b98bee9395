"""The documents name only what exists, and their code runs."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
_FOLDERS = "systems|diagrams|analysis|studies|tests|benchmarks|tools|docs"
#: A file or folder of ours in code quotes, and what it is to hold.
NAMED_FILE = rf"`((?:{_FOLDERS})/[\w./-]*)(?:: (\w+))?`"


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


def test_every_test_that_errata_names_exists() -> None:
    named = re.findall(r"`(test_\w+)`", text("docs/errata.md"))
    assert set(named) <= errata_tests()


def test_every_erratum_test_stands_in_the_table() -> None:
    named = {name for cell in errata().values() for name in cell.strip("`").split("`")}
    assert errata_tests() <= named


def test_links_lead_somewhere() -> None:
    links = [
        (path, target)
        for path in DOCUMENTS
        for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text("utf-8"))
        if not target.startswith(("http:", "https:", "mailto:"))
    ]
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
