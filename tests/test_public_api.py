"""``import phonotaxis``: cheap to import, typed, and one door to everything."""

from __future__ import annotations

import csv
import html
import inspect
import json
import re
import runpy
import subprocess
import sys
import tomllib
from dataclasses import asdict, fields
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import soundfile
from ruamel.yaml import YAML

import diagrams
import phonotaxis
from analysis.stability import report_parts
from tests.analysis.arrays.plane_waves import RATE, SQUARE, plane_waves

ROOT = Path(__file__).resolve().parents[1]
IMPORT = """
import sys, time
start = time.perf_counter()
import phonotaxis
print(time.perf_counter() - start, *sys.modules)
"""


def imported() -> tuple[float, set[str]]:
    words = subprocess.run(
        [sys.executable, "-c", IMPORT],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return float(words[0]), {name.partition(".")[0] for name in words[1:]}


def test_import_takes_less_than_a_tenth_of_a_second():
    seconds, loaded = min((imported() for _ in range(3)), key=lambda found: found[0])
    assert seconds < 0.1
    assert not {"numpy", "pydrake", "pydantic", "diagrams", "analysis"} & loaded


def test_every_public_name_is_there():
    assert set(phonotaxis.__all__) <= set(dir(phonotaxis))
    for name in phonotaxis.__all__:
        assert getattr(phonotaxis, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'simulation'"):
        getattr(phonotaxis, "simulation")  # noqa: B009  # mypy knows it, too


def test_one_version_is_stated_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text("utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text("utf-8")
    stated = project["version"]
    assert phonotaxis.__version__ == version("phonotaxis") == stated
    assert citation["version"] == stated
    assert f"## [{stated}] - {citation['date-released']}" in changes
    assert changes.index("## [Unreleased]") < changes.index(f"## [{stated}]")


@pytest.fixture(scope="module")
def run() -> phonotaxis.RunResult:
    scenario = phonotaxis.load_scenario(
        "obstacle_free", {"hearing": "ideal", "duration_s": 1.0}
    )
    return phonotaxis.simulate(scenario)


def test_settings_may_be_a_mapping():
    named = phonotaxis.load_scenario(
        "default", {"source.speed_m_s": 0.2, "obstacles.0.size_m": (0.2, 0.1)}
    )
    listed = phonotaxis.load_scenario(
        "default", ["source.speed_m_s=0.2", "obstacles.0.size_m=[0.2, 0.1]"]
    )
    assert named == listed
    with pytest.raises(phonotaxis.InputError, match=r"seed: .* is not a plain value"):
        phonotaxis.load_scenario("default", {"seed": np.int64(3)})
    with pytest.raises(phonotaxis.InputError, match="give a list of key=value"):
        phonotaxis.load_scenario("default", "hearing=ideal")


def test_a_run_is_that_of_the_diagrams(run: phonotaxis.RunResult):
    ours = diagrams.simulate(run.scenario)
    own = {each.name for each in fields(run)} - {each.name for each in fields(ours)}
    assert own == {"audio", "movie_file"}
    assert run.trajectory.equals(ours.trajectory)
    assert run.ending == ours.ending


def test_a_run_is_shown_on_one_short_line(run: phonotaxis.RunResult):
    assert repr(run) == (
        "<RunResult obstacle_free, law active, seed 1: completed after 1.0 s>"
    )


def test_tables_lose_no_digit(run: phonotaxis.RunResult, tmp_path: Path):
    with run.to_csv(tmp_path / "run.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == list(run.trajectory)
    numbers = [[float(cell or "nan") for cell in row] for row in rows]
    np.testing.assert_array_equal(np.array(numbers), run.trajectory.to_numpy())
    binary = pd.read_parquet(run.to_parquet(tmp_path / "run.parquet"))
    pd.testing.assert_frame_equal(binary, run.trajectory, check_exact=True)


def test_every_function_has_a_result_of_one_shape():
    functions = (
        "simulate", "sweep", "compare", "stability", "design", "locate", "listen",
        "calibrate", "locate_delays", "calibrate_delays", "array_resolution",
    )  # fmt: skip
    for name in functions:
        kind = getattr(
            phonotaxis, inspect.signature(getattr(phonotaxis, name)).return_annotation
        )
        assert issubclass(kind, phonotaxis.Result)
        assert not inspect.isabstract(kind)
        assert kind.__str__ is not object.__str__


def test_a_run_is_printed_as_by_the_command(
    run: phonotaxis.RunResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """But for the times and the place."""
    scenario = run.save(tmp_path / "api") / "scenario.yaml"
    words = ["simulate", str(scenario), "--no-plots", "--out", str(tmp_path / "out")]
    assert phonotaxis.main(words) == 0
    printed = capsys.readouterr().out.splitlines()
    lines = str(run).splitlines()
    assert [line[:21] for line in printed] == [
        *(line[:21] for line in lines), f"{'results':21}", f"{'replay':21}"
    ]  # fmt: skip
    assert printed[1:-3] == lines[1:-1]
    saved = json.loads((tmp_path / "api" / "summary.json").read_text("utf-8"))
    assert saved == {**run.document(), "out": str(tmp_path / "api")}


def test_a_run_saves_its_sound_and_a_movie(tmp_path: Path):
    scenario = phonotaxis.load_scenario("default", {"duration_s": 0.5})
    run = phonotaxis.simulate(
        scenario, save_audio=tmp_path / "ears", movie=tmp_path / "run.gif"
    )
    assert {path.name for path in tmp_path.iterdir()} == {"ears", "run.gif"}
    document = run.document()
    assert document["movie"] == str(tmp_path / "run.gif")
    assert document["audio"]["directory"] == str(tmp_path / "ears")
    assert (tmp_path / "ears" / "heard.wav").is_file()
    with pytest.raises(phonotaxis.InputError, match=r"save_audio: .*not empty"):
        phonotaxis.simulate(scenario, save_audio=tmp_path / "ears")


def test_a_finished_run_becomes_a_movie(run: phonotaxis.RunResult, tmp_path: Path):
    """One second at 10 pictures per second, and the last state."""
    from PIL import Image

    with Image.open(run.movie(tmp_path / "run.gif")) as movie:
        assert abs(getattr(movie, "n_frames") - 10) <= 1  # noqa: B009
    with pytest.raises(phonotaxis.InputError, match="movie: "):
        run.movie(tmp_path / "run.gif")


def test_a_run_is_saved_whole_and_once(run: phonotaxis.RunResult, tmp_path: Path):
    out = run.save(tmp_path / "run")
    assert {"replay.html", "summary.json", "scenario.yaml"} <= {
        path.name for path in out.iterdir()
    }
    with pytest.raises(phonotaxis.InputError, match="is not empty"):
        run.save(out)


#: A body that is slow in the first layout and faster than a guard reckons with next.
CART = {"name": "cart", "size_m": [0.5, 0.5], "waypoints_m": [[5, -2], [5, 2]]}
WARNED = {"hearing": "ideal", "duration_s": 1.0, "guard": {"obstacle_speed_m_s": 0.6}}
FIELD = "guard.obstacle_speed_m_s"
MESSAGE = (
    "the guard's assumption A1 does not hold: greatest speed of a corner of 'cart' is "
    "0.9 m/s, above 0.6 m/s (docs/guard.md)"
)


def shown(page: Path) -> str:
    """A page as it is read."""
    return re.sub("<.*?>", "", html.unescape(page.read_text("utf-8")))


def test_warnings_are_in_all_that_a_run_gives(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    settings = {
        **WARNED, "obstacles": [CART | {"speed_m_s": 2.0, "acceleration_m_s2": 0.9}]
    }  # fmt: skip
    run = phonotaxis.simulate(phonotaxis.load_scenario("obstacle_free", settings))
    told = [{"field": FIELD, "message": MESSAGE}]
    assert [asdict(each) for each in run.warnings] == told
    assert run.document()["warnings"] == told
    assert run.notes == (f"{FIELD}: {MESSAGE}",)
    assert [record.getMessage() for record in caplog.records] == [*run.notes]
    out = run.save(tmp_path / "run")
    assert json.loads((out / "summary.json").read_text("utf-8"))["warnings"] == told
    for name in ("report.html", "replay.html"):
        assert f"{FIELD}: {MESSAGE}" in shown(out / name)


def test_a_run_without_warnings_has_none(run: phonotaxis.RunResult, tmp_path: Path):
    assert run.warnings == ()
    assert run.document()["warnings"] == []
    assert "Warning" not in shown(run.save(tmp_path / "run") / "report.html")


def test_pictures_are_asked_for_by_name(run: phonotaxis.RunResult):
    assert len(run.plot().axes) == 1
    assert len(run.plot("time_series").axes) > 3
    picture = run.plot()._repr_png_()  # type: ignore[attr-defined]  # a notebook's
    assert picture.startswith(b"\x89PNG")
    with pytest.raises(phonotaxis.InputError, match="use 'trajectory'"):
        run.plot("speed")  # type: ignore[arg-type]  # what mypy is there to tell
    several = phonotaxis.simulate(
        phonotaxis.load_scenario(
            "two_followers", {"hearing": "ideal", "duration_s": 0.1}
        )
    )
    with pytest.raises(phonotaxis.InputError, match=r"result\.robots\['near'\]"):
        several.plot("time_series")


def test_script_of_a_user_runs(tmp_path: Path):
    """What mypy checks of it, ``make typecheck`` does, and CI with a wheel."""
    script = runpy.run_path(str(ROOT / "tests" / "user_script.py"))
    assert all(path.stat().st_size > 1000 for path in script["follow"](tmp_path))
    assert script["hear"]() == pytest.approx(90.0, abs=1.0)


@pytest.mark.usefixtures("no_workers")
def test_a_sweep_gives_table_and_page(tmp_path: Path):
    plan = phonotaxis.SweepPlan(
        scenario="obstacle_free",
        set={"hearing": "ideal", "duration_s": 0.5},
        grid={"law": ("none", "active")},
    )
    found = phonotaxis.sweep(plan, tmp_path / "sweep", workers=1)
    assert repr(found) == f"<SweepResult sweep: 2 runs in {tmp_path / 'sweep'}>"
    assert found.table["law"].tolist() == ["none", "active"]
    assert "law active" in str(found)
    assert (found.out / "report.html").is_file()
    assert found.save() == found.out
    copy = found.save(tmp_path / "copy")
    assert (copy / "report.html").read_bytes() == (
        found.out / "report.html"
    ).read_bytes()
    assert list(found.plot()) == ["obstacle_free"]


@pytest.mark.usefixtures("no_workers")
def test_a_sweep_counts_the_runs_with_warnings(tmp_path: Path):
    """Of two cells with two runs each one is too fast, in the terminal on one line."""
    plan = phonotaxis.SweepPlan(
        scenario="obstacle_free",
        set={**WARNED, "obstacles": [CART | {"acceleration_m_s2": 0.9}]},
        grid={"obstacles.0.speed_m_s": (0.3, 2.0)},
        runs=2,
    )
    found = phonotaxis.sweep(plan, tmp_path / "sweep", workers=1)
    told = [[], [{"field": FIELD, "message": MESSAGE}]]
    assert [json.loads(x) for x in found.table["warnings"]] == 2 * told
    counted = [{"field": FIELD, "runs": 2, "message": MESSAGE}]
    assert found.document()["warnings"] == counted
    assert [cell["warnings"] for cell in found.document()["cells"]] == [[], counted]
    line = f"Warning in 2 of 4 runs: {FIELD}: {MESSAGE}"
    assert str(found).splitlines()[-1] == line
    assert found.notes == (line,)
    page = shown(found.out / "report.html")
    assert line in page
    assert "with warnings" in page


@pytest.mark.usefixtures("no_workers")
def test_a_comparison_counts_the_runs_with_warnings(tmp_path: Path):
    """Under the laws that have a guard."""
    body = CART | {"speed_m_s": 2.0, "acceleration_m_s2": 0.9}
    found = phonotaxis.compare(
        "obstacle_free",
        laws="none,guarded",
        runs=2,
        settings={"hearing": "ideal", "duration_s": 1.0, "obstacles": [body]},
        out=tmp_path / "laws",
        workers=1,
    )
    counted = [{"field": FIELD, "runs": 2, "message": MESSAGE}]
    assert [cell["warnings"] for cell in found.document()["cells"]] == [[], counted]
    line = f"Warning in 2 of 4 runs: {FIELD}: {MESSAGE}"
    assert line in str(found).splitlines()
    assert line in shown(found.out / "report.html")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"laws": "magic"}, r"'magic' is not known"),
        ({"grid": {"hearing": "ideal"}}, "grid.hearing: is 'ideal'; give a list"),
    ],
)
def test_a_text_is_not_read_letter_by_letter(options, message, tmp_path: Path):
    with pytest.raises(phonotaxis.InputError, match=message):
        phonotaxis.compare("wall", **options, out=tmp_path / "out")


@pytest.mark.usefixtures("no_workers")
def test_a_comparison_gives_rates_and_pairs(tmp_path: Path):
    found = phonotaxis.compare(
        "two_static_obstacles",
        laws=["none", "active"],
        runs=1,
        settings={"hearing": "ideal", "duration_s": 0.5},
        out=tmp_path / "laws",
        workers=1,
    )
    (comparison,) = found.scenarios.values()
    assert [cell.label for cell in comparison.cells] == ["law none", "law active"]
    assert (comparison.pairs[0].first, comparison.pairs[0].second) == ("none", "active")
    assert "success (%)" in str(found)
    assert (found.out / "summary.json").is_file()
    with pytest.raises(phonotaxis.InputError, match="is listed twice"):
        phonotaxis.compare("wall", "wall", out=tmp_path / "twice")


def test_stability_gives_findings_and_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The first parts alone: all of them take a minute."""
    monkeypatch.setattr(report_parts, "parts_for", lambda _: [])
    for laws, names in (
        ("all", ["conventional", "active", "conventional2017", "active2017"]),
        ("conventional,active", ["conventional", "active"]),
        ("active", ["active"]),
        (("active",), ["active"]),
    ):
        by_name = phonotaxis.stability("obstacle_free", laws=laws)
        assert [each.law for each in by_name.analyses] == names
    first = report_parts.SOUND_PARTS[:2]
    monkeypatch.setattr(report_parts, "parts_for", lambda _: first)
    told: list[str] = []
    found = phonotaxis.stability("obstacle_free", progress=told.append)
    assert repr(found) == "<StabilityResult obstacle_free: active>"
    assert len(told) == 2
    assert len(found.analyses[0].sections) == 2
    assert (found.save(tmp_path / "report") / "report.html").is_file()
    # A model as a system of python-control has the poles of the document.
    system = found.state_space("continuous")
    told = found.document()["linear_models"]["continuous"]["A"]
    np.testing.assert_array_equal(system.A, told)
    assert system.isctime(strict=True)
    assert found.state_space().name == system.name
    with pytest.raises(phonotaxis.InputError, match="model: 'loops' is not a model"):
        found.state_space("loops")
    with pytest.raises(phonotaxis.InputError, match="law: 'dwa' is not analyzed"):
        found.state_space(law="dwa")


def test_stability_warns_that_other_robots_are_left_out(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    """As the command does."""
    monkeypatch.setattr(report_parts, "parts_for", lambda _: [])
    found = phonotaxis.stability("robots_2")
    phonotaxis.stability("robots_2", robot="second")
    phonotaxis.stability("unknown_block")
    first, second = (record.getMessage() for record in caplog.records)
    assert first.startswith("the report covers robot 'first' alone, without second; ")
    assert found.notes == (first,)
    assert second == "the report covers robot 'second' alone, without first"


def test_locate_takes_samples_and_files_alike(tmp_path: Path):
    places = [(0.0, 0.4), (0.0, 0.0), (0.0, -0.4)]
    times = np.arange(24_000) / 48_000.0
    noise = np.random.default_rng(2).uniform(-0.5, 0.5, 24_000)
    delays = [np.hypot(1.5, 1.0 - y) / 340.0 for _, y in places]
    samples = np.array([np.interp(times - delay, times, noise) for delay in delays])
    soundfile.write(tmp_path / "heard.wav", samples.T, 48_000, subtype="DOUBLE")
    (tmp_path / "array.yaml").write_text(f"microphones: {[list(p) for p in places]}")
    by_file = phonotaxis.locate(tmp_path / "heard.wav", tmp_path / "array.yaml")
    by_samples = phonotaxis.locate(samples, places, sample_rate_hz=48_000)
    assert by_samples.document() == by_file.document()
    bearing = by_samples.main_source()["bearing_deg"]
    assert bearing == pytest.approx(np.degrees(np.arctan2(1.0, 1.5)), abs=1.0)
    counts = np.round(samples * 32767.0).astype(np.int16)
    by_counts = phonotaxis.locate(counts, sample_rate_hz=48_000)
    assert by_counts.main_source()["bearing_deg"] == pytest.approx(bearing, abs=0.1)
    assert len(repr(by_counts)) < 100


def test_listen_gives_the_bearings_of_a_file(tmp_path: Path):
    sound = tmp_path / "heard.wav"
    soundfile.write(sound, plane_waves(-120.0, 2.0).T, RATE)
    steps: list[float] = []
    found = phonotaxis.listen(
        sound, SQUARE, step=lambda step: steps.append(step.sources.t_s)
    )
    assert steps[-1] == 2.0
    assert set(found.table["source"]) == {1}
    np.testing.assert_allclose(found.table["bearing_deg"], -120.0, atol=2.0)
    assert str(found) == "the stream has ended; 2.0 s heard, sources: 1"
    assert found.notes == ()
    out = found.save(tmp_path / "out")
    assert {path.name for path in out.iterdir()} == {
        "listen.json", "listen.png", "tracks.csv"
    }  # fmt: skip
    assert json.loads((out / "listen.json").read_text()) == {
        **found.document(), "out": str(out)
    }  # fmt: skip
    with pytest.raises(phonotaxis.InputError, match="channels: is 0"):
        phonotaxis.listen(sound, SQUARE, channels=0)


NOISE = np.random.default_rng(3).standard_normal((3, 9600))


@pytest.mark.parametrize(
    ("samples", "options", "message"),
    [
        (NOISE, {}, "sample_rate_hz: is missing"),
        (NOISE, {"sample_rate_hz": 44_100.5}, "whole number of Hz"),
        (NOISE, {"sample_rate_hz": float("nan")}, "whole number of Hz"),
        (NOISE.T, {"sample_rate_hz": 48_000}, "transpose"),
        (NOISE[0], {"sample_rate_hz": 48_000}, r"\(microphones, samples\)"),
        (NOISE[:2], {"sample_rate_hz": 48_000}, "has 2 channels, but the array"),
        (0.0 * NOISE, {"sample_rate_hz": 48_000}, "silent"),
        (NOISE * np.nan, {"sample_rate_hz": 48_000}, "not finite"),
        ([["a"] * 9], {"sample_rate_hz": 48_000}, "holds no numbers"),
        (NOISE, {"sample_rate_hz": 48_000, "geometry": [[0.0]]}, "geometry: micro"),
        (NOISE, {"sample_rate_hz": 48_000, "geometry": [1.0, 2.0]}, "of positions"),
        ("a.wav", {"sample_rate_hz": 48_000}, r"sample_rate_hz: .*file"),
    ],
)
def test_samples_that_cannot_be_used_are_refused(samples, options, message):
    with pytest.raises(phonotaxis.InputError, match=message):
        phonotaxis.locate(samples, **options)
