"""Pages for those who begin: their examples run, and none is left out."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from analysis.runs import run_summary, summary_text
from diagrams import library_scenarios, load_scenario, simulate

DOCS = Path(__file__).resolve().parents[2] / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def page(name: str) -> str:
    return (DOCS / name).read_text("utf-8")


@pytest.fixture
def office(tmp_path: Path) -> Path:
    """The scenario that docs/write_a_scenario.md builds."""
    text = page("write_a_scenario.md").partition("`office.yaml`:")[2]
    found = re.search(r"(?ms)^```yaml\n(.*?)^```$", text)
    assert found
    path = tmp_path / "office.yaml"
    path.write_text(found[1], "utf-8")
    return path


def test_scenario_of_the_page_has_what_the_page_builds(office: Path) -> None:
    whole = office.read_text("utf-8").splitlines()
    pieces = re.findall(r"(?ms)^```yaml\n(.*?)^```$", page("write_a_scenario.md"))
    assert len(pieces) == 5
    for piece in pieces[1:4]:
        lines = [line.partition("  #")[0].rstrip() for line in piece.splitlines()]
        assert set(lines) <= set(whole)
    scenario = load_scenario(office)
    assert scenario.room is not None
    assert list(scenario.all_sources) == ["source", "radio"]
    assert scenario.target("robot") == "source"
    assert [body.name for body in scenario.obstacles] == ["box", "cart"]


@pytest.mark.slow
def test_scenario_of_the_page_ends_as_the_page_says(office: Path) -> None:
    told = re.findall(
        r"phonotaxis simulate office.yaml(?: --law (\w+))? +# (\w+).*after ([\d.]+) s",
        page("write_a_scenario.md"),
    )
    assert len(told) == 2
    for law, cause, seconds in told:
        scenario = load_scenario(office, [f"law={law}"] if law else [])
        result = simulate(scenario, engine="compiled")
        assert (result.cause, f"{result.simulated_s:.1f}") == (cause, seconds)


@pytest.mark.slow
def test_tutorial_reads_what_the_default_run_prints() -> None:
    found = re.search(r"(?ms)^```text\n(.*?)^```$", page("tutorial.md"))
    assert found
    result = simulate(load_scenario("default"), engine="compiled")
    printed = summary_text(result, run_summary(result, None)).splitlines()
    changing = ("speed", "results", "replay")
    told = [line for line in found[1].splitlines() if not line.startswith(changing)]
    assert told == [line for line in printed if not line.startswith(changing)]


def test_gallery_shows_every_scenario() -> None:
    shown = re.findall(r"(?m)^## (\w+)$", page("gallery.md"))
    assert shown == list(library_scenarios())
    pictures = re.findall(r"\]\((images/gallery/\w+\.webp)\)", page("gallery.md"))
    assert [Path(picture).stem for picture in pictures] == shown
    assert all((DOCS / picture).is_file() for picture in pictures)


def test_first_page_names_every_page() -> None:
    named = set(re.findall(r"\]\(([\w./]+)\)", page("index.md")))
    pages = {path.name for path in DOCS.glob("*.md")} - {"index.md"}
    assert pages | {f"notebooks/{path.name}" for path in NOTEBOOKS} <= named


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_hold_nothing_that_grows_old(path: Path) -> None:
    cells: list[dict[str, Any]] = json.loads(path.read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert not [c for c in code if c["outputs"] or c["execution_count"] is not None]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_says_what_to_install(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its first cell, run by a Python that lacks the project."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    first = next(cell for cell in cells if cell["cell_type"] == "code")
    code = "".join(line for line in first["source"] if not line.startswith("%"))
    monkeypatch.setitem(sys.modules, "phonotaxis", None)
    with pytest.raises(SystemExit, match=r"pip install -e '.\[docs\]'"):
        exec(code, {})
