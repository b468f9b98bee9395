"""What a sweep refuses: too much work, and files that have changed."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from analysis.batches.batch import prepare_comparison
from analysis.batches.comparison_plans import comparison_plan
from analysis.batches.options import MOST_WORKERS
from analysis.batches.page import write_batch
from analysis.batches.plan import MOST_RUNS, SweepPlan
from analysis.batches.report import batch_document
from analysis.batches.sweep import prepare_sweep
from analysis.run_error import RunError
from systems.framework.input_error import InputError

QUICK = {"hearing": "ideal", "duration_s": 0.1}


@pytest.fixture
def law(tmp_path, monkeypatch) -> Path:
    """A module in the working directory that uses another one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "law_helper", raising=False)
    (tmp_path / "law_helper.py").write_text("GAIN = 1.0\n")
    file = tmp_path / "resumed_law.py"
    file.write_text(
        "import sys\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "import law_helper\n"
        "def soft(c, s, laws):\n    return law_helper.GAIN / c\n"
    )
    return file


@pytest.mark.parametrize("changed", ["resumed_law.py", "law_helper.py"])
def test_a_law_that_has_changed_is_not_gone_on_with(law, changed):
    for part in ("set", "grid"):
        name = f"{law}:soft"
        value = name if part == "set" else [name, "active"]
        fields = {"set": QUICK, part: (QUICK if part == "set" else {}) | {"law": value}}

        def plan(fields=fields) -> SweepPlan:
            return SweepPlan.model_validate(fields)

        out = law.parent / f"out_{part}"
        prepare_sweep(plan(), out).store.close()
        prepare_sweep(plan(), out, resume=True).store.close()
        file = law.parent / changed
        file.write_text(file.read_text() + "# another gain\n")
        with pytest.raises(InputError, match=f"differs in .*{changed}"):
            prepare_sweep(plan(), out, resume=True)


def test_a_sound_that_has_changed_is_not_gone_on_with(tmp_path):
    def write(seed: int) -> None:
        samples = np.random.default_rng(seed).normal(scale=0.1, size=44_100)
        soundfile.write(tmp_path / "sound.wav", samples, 44_100)

    def plan() -> SweepPlan:
        sound = {"kind": "wav", "file": "sound.wav"}
        return SweepPlan.model_validate(
            {"set": QUICK, "grid": {"sound": [sound]}, "folder": str(tmp_path)}
        )

    write(1)
    out = tmp_path / "out"
    prepare_sweep(plan(), out).store.close()
    prepare_sweep(plan(), out, resume=True).store.close()
    write(2)
    with pytest.raises(InputError, match=r"differs in .*sound\.wav"):
        prepare_sweep(plan(), out, resume=True)


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"runs": 10**9}, "runs"),
        ({"runs": MOST_RUNS // 10, "grid": {"seed_": list(range(11))}}, "grid"),
        (
            {"grid": {key: list(range(1000)) for key in ("a.b", "c.d", "e.f")}},
            "grid",
        ),
    ],
)
def test_more_runs_than_anybody_can_wait_for(fields, field):
    with pytest.raises(ValueError, match=field):
        SweepPlan.model_validate(fields)


@pytest.mark.parametrize("workers", [0, MOST_WORKERS + 1, 10**19])
def test_workers_that_a_machine_cannot_have(tmp_path, workers):
    with pytest.raises(InputError, match=r"workers: .* must lie between 1 and 256"):
        prepare_sweep(SweepPlan(), tmp_path / "out", workers=workers)
    assert not (tmp_path / "out").exists()


def test_two_comparisons_never_share_a_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    plans = {"wall": comparison_plan("wall", laws=["none"], runs=1, settings=QUICK)}
    first, second = (prepare_comparison(plans) for _ in range(2))
    assert (first.out, second.out) == (Path("results/0001"), Path("results/0002"))
    with pytest.raises(InputError, match="out: results/0001 is not empty"):
        prepare_comparison(plans, first.out)
    for prepared in (first, second):
        assert (prepared.out / "wall" / "sweep.json").is_file()
        prepared.sweeps["wall"].store.close()


@pytest.mark.usefixtures("no_workers")
def test_a_comparison_of_which_nothing_ran_says_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "failing_law.py").write_text(
        "def late(c, s, laws):\n"
        "    return None if 0.35 < c < 1.4 or 1.55 < c < 2.9 else 0.0\n"
    )
    settings = {**QUICK, "duration_s": 20.0, "obstacle_sensing": "ideal"}
    laws = [f"{tmp_path / 'failing_law.py'}:late"]
    plans = {
        "x": comparison_plan(
            "two_static_obstacles", laws=laws, runs=1, settings=settings
        )
    }
    prepared = prepare_comparison(plans, tmp_path / "out", workers=1)
    batch = prepared.run()
    write_batch(batch, batch_document(batch))
    assert "InputError" in (tmp_path / "out" / "report.html").read_text("utf-8")
    with pytest.raises(RunError, match="all 1 runs failed, the first one by Inp"):
        batch.require_runs()
    assert (tmp_path / "out" / "x" / "runs.parquet").is_file()


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{}", b"null", b'{"plan_sha256": 1, "versions": 2}', b"\xff"],
)
def test_a_damaged_directory_is_not_gone_on_with(tmp_path, content):
    (tmp_path / "sweep.json").write_bytes(content)
    (tmp_path / "sweep.yaml").write_bytes(content)
    with pytest.raises(InputError, match=r"out: .* holds"):
        prepare_sweep(SweepPlan(), tmp_path, resume=True)
