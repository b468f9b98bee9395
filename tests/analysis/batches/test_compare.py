"""Plans of comparisons, the library's layouts, and a small one from end to end."""

from __future__ import annotations

import html
import json
from pathlib import Path

import numpy as np
import pytest

from analysis.batches.batch import prepare_comparison
from analysis.batches.comparison_plans import (
    EXPERIMENTS,
    comparison_plan,
    comparison_plans,
    library_layouts,
)
from analysis.batches.page import write_batch
from analysis.batches.plan import SweepPlan, load_sweep
from analysis.batches.report import batch_document, batch_text
from diagrams import load_scenario, simulate
from systems.framework.input_error import InputError

IDEAL = {"hearing": "ideal"}


def test_every_experiment_has_layouts():
    assert set(EXPERIMENTS) <= set(library_layouts())


@pytest.mark.parametrize("name", library_layouts())
def test_layouts_of_the_library_are_valid_and_differ(name):
    plan = load_sweep(library_layouts()[name])
    laws = ("none", "active")
    scenario = load_scenario(plan.scenario)
    kinds = {robot.kind for robot in scenario.robots.values()}
    if "router" in kinds:
        laws = ("trajectory_conventional", "trajectory_filtered")
    if len(scenario.robots) > 1 or not kinds <= {"follower", "router"}:
        plan = plan.model_copy(update={"runs": 20})
    else:
        plan = comparison_plan(name, laws=laws, runs=20)
    points = plan.points()
    drawn = {json.dumps(p.fields | {"law": ""}) for p in points}
    assert len(drawn) == 20
    assert plan.scenario_of(points[0]).name == name


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_sources_and_obstacles_stay_where_sound_and_echoes_reach(name):
    """Inside the papers' floors, but for where moving obstacles come from."""
    plan = comparison_plan(name, laws=("none",), runs=50)
    for point in plan.points():
        scenario = plan.scenario_of(point)
        waypoints = np.array(scenario.source.waypoints_m)
        assert np.all(np.ptp(waypoints, axis=0) <= scenario.arena_m)
        for obstacle in scenario.obstacles:
            if not obstacle.path().moves:
                assert abs(obstacle.waypoints_m[0][1]) <= 0.6


def test_laws_meet_the_same_layouts_with_the_same_noise():
    plan = comparison_plan("one_moving_obstacle", laws=("none", "active"), runs=3)
    points = plan.points()
    for none, active in zip(points[::2], points[1::2], strict=True):
        one, other = plan.scenario_of(none), plan.scenario_of(active)
        assert (one.only.law, other.only.law) == ("none", "active")
        assert one.with_robot(law="active") == other


def test_a_layout_does_not_depend_on_laws_or_runs():
    few = comparison_plan("two_static_obstacles", laws=("none",), runs=2)
    many = comparison_plan("two_static_obstacles", laws=("active", "none"), runs=5)
    for name in few.draw:
        values = [[p.fields[name] for p in plan.points()] for plan in (few, many)]
        assert values[1][::2][:2] == values[0]


def test_the_recommended_attraction_meets_the_same_layouts():
    printed, recommended = (
        comparison_plan(name, laws=("active",), runs=5)
        for name in ("two_static_obstacles", "two_static_obstacles_recommended")
    )
    for one, other in zip(printed.points(), recommended.points(), strict=True):
        a, b = printed.scenario_of(one), recommended.scenario_of(other)
        own = {"attraction": a.follower.attraction, "laws": a.follower.laws}
        assert a.follower.attraction != b.follower.attraction
        assert b.with_robot(**own).model_copy(update={"name": a.name}) == a


def test_a_users_own_layouts(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "scenario: default\n"
        "draw:\n  obstacles.0.waypoints_m.0.1: {uniform: [0.5, 0.9]}\n"
    )
    plan = comparison_plan(str(file), laws=("none",), runs=2, settings=IDEAL)
    scenario = plan.scenario_of(plan.points()[0])
    assert scenario.follower.hearing == "ideal"
    assert 0.5 <= scenario.obstacles[0].waypoints_m[0][1] <= 0.9


def test_a_users_own_scenario_differs_in_noise_alone(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("duration_s: 3\n")
    plan = comparison_plan(str(file), laws=("none",), runs=2)
    one, other = (plan.scenario_of(point) for point in plan.points())
    assert one.seed != other.seed
    assert one.model_copy(update={"seed": other.seed}) == other


def test_layouts_that_set_what_the_comparison_sets_are_refused(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("scenario: default\nruns: 3\n")
    with pytest.raises(InputError, match=r"runs: .*remove it"):
        comparison_plan(str(file))


@pytest.mark.parametrize(
    ("words", "field"),
    [
        ({"scenarios": ["no_such"]}, "scenario"),
        ({"scenarios": ["default", "default"]}, "scenario"),
        ({"runs": 0}, "runs"),
        ({"seed": -1}, "seed"),
        ({"settings": ["law=none"]}, "grid.law"),
        ({"settings": ["duration_s"]}, "duration_s"),
        ({"grid": ["hearing=audio"]}, "hearing"),
    ],
)
def test_mistakes_are_named(words, field):
    with pytest.raises(InputError) as caught:
        comparison_plans(**words)
    assert caught.value.field == field


TERM = "collision_vector.velocity_term"


def test_velocity_terms_are_set_or_compared():
    (one,) = comparison_plans(["default"], settings=[f"{TERM}=closing"]).values()
    assert one.set == {TERM: "closing"}
    (both,) = comparison_plans(
        ["default"], settings=[f"{TERM}=printed,closing"]
    ).values()
    assert len(both.cells()) == 10


def test_what_cannot_be_prepared_leaves_nothing(tmp_path):
    bad = tmp_path / "bad.yaml"
    draw = "  start.position_m.0: {uniform: [1.5, 1.7]}"
    bad.write_text(f"scenario: default\ndraw:\n{draw}\n")
    plans = {
        "first": comparison_plan("default", runs=1),
        "bad": comparison_plan(str(bad), runs=20),
    }
    with pytest.raises(InputError, match="is on the robot"):
        prepare_comparison(plans, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("no_workers")
@pytest.mark.slow
def test_a_comparison_from_end_to_end(tmp_path):
    """Two laws on two short layouts; examples run again as they ran."""
    short = IDEAL | {"duration_s": 3.0}
    plans = {
        "two_static_obstacles": comparison_plan(
            "two_static_obstacles", laws=("none", "active"), runs=2, settings=short
        )
    }
    prepared = prepare_comparison(plans, tmp_path / "out", workers=1)
    seen: list[int] = []
    batch = prepared.run(seen.append)
    assert seen[-1] == prepared.runs == 4
    summary = batch_document(batch)
    write_batch(batch, summary)
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    page = html.unescape((tmp_path / "out" / "report.html").read_text())
    cells = summary["cells"]
    assert [(c["scenario"], c["fields"], c["runs"]) for c in cells] == [
        ("two_static_obstacles", {"law": "none"}, 2),
        ("two_static_obstacles", {"law": "active"}, 2),
    ]
    for cell in cells:
        for rate in ("success", "collision"):
            assert cell[rate]["low"] <= cell[rate]["value"] <= cell[rate]["high"]
        for example in cell["examples"]:
            again = load_scenario(tmp_path / "out" / example["scenario_file"])
            assert simulate(again).cause == example["cause"]
            text = batch_text(batch, summary)
            assert example["command"] in text
            assert example["command"] in page
            replay = Path(example["scenario_file"]).with_suffix(".html")
            assert (str(replay) in page) == (example["kind"] == "typical")
            assert (tmp_path / "out" / replay).exists() == (str(replay) in page)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "summary.json",
        "report.html",
        "two_static_obstacles",
        "examples",
    }
    assert (tmp_path / "out" / "examples" / "two_static_obstacles.png").is_file()


def called(names: list[str]) -> dict[str, SweepPlan]:
    """A plan of one short run for each name."""
    short = IDEAL | {"duration_s": 0.05}
    return {
        name: comparison_plan("wall", laws=("none",), runs=1, settings=short)
        for name in names
    }


@pytest.mark.usefixtures("no_workers")
@pytest.mark.slow
def test_scenarios_that_are_called_like_results(tmp_path):
    """No run and no file is lost."""
    names, out = ["summary.json", "examples"], tmp_path / "out"
    prepared = prepare_comparison(called(names), out, workers=1)
    batch = prepared.run()
    summary = batch_document(batch)
    write_batch(batch, summary)
    assert summary == json.loads((out / "summary.json").read_text())
    assert [cell["scenario"] for cell in summary["cells"]] == names
    assert {path.name for path in out.iterdir()} == {
        *("summary.json", "report.html", "examples"),
        *("summary.json-2", "examples-2"),
    }
    again = prepare_comparison(called(names), out, workers=1, resume=True)
    assert again.done == again.runs == 2
    again.run()


def test_no_scenario_gets_the_folder_of_another_or_one_outside(tmp_path):
    names = ["summary.json", "report.html", "examples", "..", "A", "a"]
    out = tmp_path / "all" / "out"
    prepared = prepare_comparison(called([*names, "x" * 240, "c:1"]), out, workers=1)
    for sweep in prepared.sweeps.values():
        sweep.store.close()
    assert [path.name for path in (tmp_path / "all").iterdir()] == ["out"]
    assert {path.name for path in out.iterdir()} == {
        *("summary.json-2", "report.html-2", "examples-2", "unnamed", "A"),
        *("a-2", "x" * 200, "c-1"),
    }
