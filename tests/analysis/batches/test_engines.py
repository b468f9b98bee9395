"""Many runs are compiled where they can be, and say so."""

from __future__ import annotations

import logging

import pandas as pd
import pytest

import analysis.batches.sweep as sweeps
from analysis.batches.plan import SweepPlan
from analysis.batches.sweep import prepare_sweep

pytestmark = pytest.mark.usefixtures("no_workers")

LAWS = """
def wordy(c, s, laws):
    return 2.0 / float(str(c))
"""


@pytest.fixture(autouse=True)
def laws(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeps, "MANY_RUNS", 4)
    file = tmp_path / "many_laws.py"
    file.write_text(LAWS)
    return file


def swept(out, runs, law, **fields):
    plan = SweepPlan(
        scenario="two_static_obstacles",
        set={"hearing": "ideal", "duration_s": 2.0, **fields},
        grid={"law": law},
        runs=runs,
    )
    return prepare_sweep(plan, out, workers=1).run()


@pytest.mark.slow
def test_many_runs_are_compiled(tmp_path):
    few = swept(tmp_path / "few", 1, ("active",))
    many = swept(tmp_path / "many", 4, ("active",))
    assert list(few["engine"]) == ["drake"]
    assert list(many["engine"]) == ["compiled"] * 4
    numbers = few.select_dtypes("float").columns.drop("wall_s")
    pd.testing.assert_frame_equal(
        many.loc[:0, numbers], few[numbers], rtol=1e-6, atol=1e-9
    )


@pytest.mark.slow
def test_a_law_that_numba_does_not_know_leaves_them_to_drake(tmp_path, laws, caplog):
    with caplog.at_level(logging.WARNING, "phonotaxis"):
        table = swept(tmp_path / "out", 2, ("active", f"{laws}:wordy"))
    assert list(table["engine"]) == ["drake"] * 4
    assert "cannot compile" in caplog.text
    assert "wordy" in caplog.text


@pytest.mark.slow
def test_an_engine_that_is_asked_for_runs_few(tmp_path):
    table = swept(tmp_path / "out", 1, ("active",), engine="compiled")
    assert list(table["engine"]) == ["compiled"]
