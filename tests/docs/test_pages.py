"""Pages with code: a reader who types what they show gets through."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

import phonotaxis
from analysis.stability.law_analysis import LawAnalysis, analyze_law
from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from docs.building.page_code import Block, page_blocks, page_file

PAGES = (
    "first_run.md",
    "your_scenario.md",
    "your_law.md",
    "extending.md",
    "test_your_block.md",
    "stability_report.md",
    "your_recording.md",
    "your_diagram.md",
    "maps.md",
)
#: What only works in a clone, and was done before.
IN_A_CLONE = ("make ", ". .venv", "git ", "pip ", "cd ")


def test_the_scenario_of_the_page_is_one() -> None:
    office = page_file("your_scenario.md", "office.yaml")
    scenario = scenario_from_mapping(YAML(typ="safe").load(office))
    assert list(scenario.sources) == ["source", "radio"]
    assert [body.name for body in scenario.obstacles] == ["box", "cart"]


@pytest.mark.usefixtures("no_workers")
@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_what_the_page_shows_works(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its order, in a folder of its own; the reader's tests at the end, at once."""
    monkeypatch.setattr("phonotaxis.loops.analyze_law", analyzed_once())
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    namespace: dict[str, Any] = {"__name__": page}
    blocks = page_blocks(page)
    assert blocks
    tests: list[str] = []
    untried: set[str] = set()
    for block in blocks:
        if block.file:
            (tmp_path / block.file).write_text(block.text, "utf-8")
            if block.file.endswith(".py"):
                untried |= {block.file.removesuffix(".py")}
        elif block.language == "python":
            exec(compile(block.text, page, "exec"), namespace)
        elif tested := re.fullmatch(r"python -m pytest -q (\S+)\n", block.text):
            tests.append(tested[1])
        elif (new := {name for name in untried if name in block.text}) or not (
            commands := plain_commands(block)
        ):
            run_in_shell(block)
            untried -= new
        else:
            for words in commands:
                assert phonotaxis.main(words) == 0, words
    if tests:
        run_in_shell(Block("sh", f"python -m pytest -q {' '.join(tests)}\n", ""))


def analyzed_once() -> Callable[..., LawAnalysis]:
    """``analyze_law``, which takes 20 s, but once for the command and in Python."""
    known: dict[str, LawAnalysis] = {}

    def analyzed(scenario: Scenario, *parts: Any, **options: Any) -> LawAnalysis:
        # Gains of other laws may be stated or not, and play no part.
        fields = json.loads(scenario.model_dump_json())
        fields["laws"] = fields["laws"].get(scenario.only.law)
        key = json.dumps(fields)
        if key not in known:
            known[key] = analyze_law(scenario, *parts, **options)
        return known[key]

    return analyzed


def plain_commands(block: Block) -> list[list[str]]:
    """The arguments of each ``phonotaxis`` of a block that has nothing else, or none.

    They run in the process of the tests. A process of its own takes 3 s to start, and
    is for the first use of a module of the reader, and for pipes.
    """
    lines = block.text.replace("\\\n", " ").splitlines()
    lines = [line for line in lines if not line.startswith(IN_A_CLONE)]
    if any(re.search(r"[|<>&$;]|^(?!phonotaxis )", line) for line in lines):
        return []
    return [shlex.split(line)[1:] for line in lines]


def run_in_shell(block: Block) -> None:
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    lines = block.text.splitlines(keepends=True)
    script = "".join(line for line in lines if not line.startswith(IN_A_CLONE))
    done = subprocess.run(
        ["bash", "-euc", script],
        env=os.environ | {"PATH": programs},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{script}\n{done.stdout}\n{done.stderr}"
