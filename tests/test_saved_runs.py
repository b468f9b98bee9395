"""A run that is loaded from its directory is the run that was saved there."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import phonotaxis

#: A collision with the source, several robots of which one follows the other, and a
#: search whose radio fills columns of the operator's computer.
SCENARIOS: dict[str, dict[str, object]] = {
    "default": {
        "hearing": "ideal",
        "law": "none",
        "obstacles.0.waypoints_m": [[0.9, 0.0]],
    },
    "convoy": {"hearing": "ideal", "duration_s": 2.0},
    "odor_then_sound": {"duration_s": 3.0},
}


@pytest.fixture(scope="module", params=SCENARIOS)
def run(request: pytest.FixtureRequest) -> phonotaxis.RunResult:
    return phonotaxis.simulate(request.param, SCENARIOS[request.param])


def test_a_run_is_loaded_as_it_was_saved(run: phonotaxis.RunResult, tmp_path: Path):
    document = {**run.document(), "out": str(tmp_path)}
    run.write(document, tmp_path, pictures=False)
    loaded = phonotaxis.load_run(tmp_path)
    assert loaded.document() == run.document()
    assert str(loaded) == str(run)
    assert repr(loaded) == repr(run)
    assert loaded.trajectory.equals(run.trajectory)
    assert loaded.robots.keys() == run.robots.keys()
    for name, own in run.robots.items():
        assert loaded.robots[name].columns.keys() == own.columns.keys()
        for key, values in own.columns.items():
            assert np.array_equal(loaded.robots[name].columns[key], values, True), key
    assert loaded.world.keys() == run.world.keys()


def test_the_first_scenario_ends_in_a_collision():
    assert phonotaxis.simulate("default", SCENARIOS["default"]).collision is not None


def test_what_is_no_run_is_refused(run: phonotaxis.RunResult, tmp_path: Path):
    with pytest.raises(phonotaxis.InputError, match=r"has no scenario\.yaml; give the"):
        phonotaxis.load_run(tmp_path)
    run.write({**run.document(), "out": str(tmp_path)}, tmp_path, pictures=False)
    summary = tmp_path / "summary.json"
    summary.write_text(json.dumps({**run.document(), "schema_version": 1}))
    with pytest.raises(phonotaxis.InputError, match="not the summary of a run by this"):
        phonotaxis.load_run(tmp_path)
    summary.unlink()
    with pytest.raises(phonotaxis.InputError, match=r"summary\.json' cannot be read"):
        phonotaxis.load_run(tmp_path)
