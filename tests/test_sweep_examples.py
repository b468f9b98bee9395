"""docs/compare.md shows what works."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pandas as pd
import pytest
from ruamel.yaml import YAML

import phonotaxis
from analysis.batches.plan import load_sweep

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "compare.md").read_text("utf-8")
EXAMPLE = ROOT / "docs" / "examples" / "crossing.yaml"


def blocks(language: str) -> list[str]:
    return re.findall(rf"(?ms)^```{language}\n(.*?)^```$", PAGE)


def test_the_example_is_the_file():
    yaml = YAML(typ="safe")
    assert yaml.load(blocks("yaml")[0]) == yaml.load(EXAMPLE)
    assert len(load_sweep(EXAMPLE).points()) == 240


@pytest.mark.usefixtures("no_workers")
@pytest.mark.slow
def test_the_commands_and_the_script_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    example = tmp_path / EXAMPLE.relative_to(ROOT)
    example.parent.mkdir(parents=True)
    text = EXAMPLE.read_text("utf-8")
    for long, short in (
        ("runs: 40", "runs: 1"),
        ("hearing: ideal", "hearing: ideal, duration_s: 1"),
        ("source.speed_m_s: [0.2, 0.3, 0.4]", "source.speed_m_s: [0.2]"),
    ):
        assert long in text
        text = text.replace(long, short)
    example.write_text(text)
    commands = blocks("sh")[0].splitlines()
    for command in commands:
        program, *words = shlex.split(command)
        assert program == "phonotaxis"
        assert phonotaxis.main(words) == 0
    assert len(pd.read_parquet("results/crossing/runs.parquet")) == 2
    exec(blocks("python")[0], {})
    assert "completed" in capsys.readouterr().out
