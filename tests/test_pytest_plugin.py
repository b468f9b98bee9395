"""The pytest plugin: its fixtures, and what it costs everyone else."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

from phonotaxis_pytest import evaluate, quick_scenario, seed  # noqa: F401  # fixtures
from systems import CollisionVector

ROOT = Path(__file__).resolve().parents[1]


def test_fixtures(evaluate, quick_scenario, seed):  # noqa: F811
    found = evaluate(CollisionVector(), ranges=[0.6, 0.6, 3.0], echo=[1, 1, 0])
    assert found["features"].tolist() == [4.0, 0.0, 0.0]
    scenario = quick_scenario("wall", seed=seed, law="conventional")
    assert (scenario.law_names, scenario.duration_s) == ("conventional", 2.0)
    assert scenario.only.hearing == "ideal"
    assert quick_scenario("known_u", duration_s=3.0).duration_s == 3.0
    assert quick_scenario(hearing="audio").only.hearing == "audio"
    assert seed == 3386568290, "the same on every machine"


def test_it_is_installed_and_loads_nothing_else():
    """It does not even load phonotaxis, which a user's folder could hide."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    entries = project["project"]["entry-points"]["pytest11"]
    assert entries == {"phonotaxis_pytest": "phonotaxis_pytest"}
    assert project["tool"]["setuptools"]["py-modules"] == ["phonotaxis_pytest"]
    code = "import pytest, sys; before = {*sys.modules}; import phonotaxis_pytest"
    words = [sys.executable, "-c", code + "; print(*sorted({*sys.modules} - before))"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["phonotaxis_pytest"]
