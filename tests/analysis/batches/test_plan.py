from __future__ import annotations

import json
import shlex
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from analysis.batches.plan import SweepPlan, dump_plan, load_sweep
from analysis.batches.sweep import reproducing_command
from diagrams import dump_scenario, load_scenario
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError

SPEED = "obstacles.0.speed_m_s"
X = ("obstacles.0.waypoints_m.0.0", "obstacles.0.waypoints_m.1.0")
PLAN: dict[str, Any] = {
    "scenario": "one_moving_obstacle",
    "set": {"hearing": "ideal"},
    "grid": {
        "law": ["conventional", "active"],
        "attraction.stiffness_n_m": [8.0, 16.0],
    },
    "draw": {SPEED: {"uniform": [0.1, 0.5]}, ", ".join(X): {"normal": [2.6, 0.3]}},
    "runs": 3,
    "seed": 4,
}


def plan(**changes) -> SweepPlan:
    return SweepPlan.model_validate({**PLAN, **changes})


def written(path, text):
    path.write_text(text)
    return path


def test_cells_are_the_crossed_grid():
    laws, gains = PLAN["grid"]["law"], PLAN["grid"]["attraction.stiffness_n_m"]
    crossed = [
        {"law": law, "attraction.stiffness_n_m": gain} for law in laws for gain in gains
    ]
    assert plan().cells() == crossed
    assert plan(grid={}).cells() == [{}]


def test_index_counts_cells_within_runs():
    points = plan().points()
    assert [point.index for point in points] == list(range(12))
    assert [(point.run, point.cell) for point in points] == [
        (run, cell) for run in range(3) for cell in range(4)
    ]


def test_scenario_has_every_field():
    sweep = plan()
    point = sweep.points()[-1]
    scenario = sweep.scenario_of(point)
    assert scenario.follower.hearing == "ideal"
    assert scenario.only.law == "active"
    assert scenario.follower.attraction.stiffness_n_m == 16.0
    assert scenario.seed == point.seed
    obstacle = scenario.obstacles[0]
    assert obstacle.speed_m_s == point.fields[SPEED]
    assert [corner[0] for corner in obstacle.waypoints_m] == [point.fields[X[0]]] * 2
    original = load_scenario("one_moving_obstacle").obstacles[0].waypoints_m
    assert [corner[1] for corner in obstacle.waypoints_m] == [y for _, y in original]


def test_paired_cells_share_draws_and_seeds():
    points = plan().points()
    for run in range(3):
        shared = {
            (point.seed, point.fields[SPEED], point.fields[X[0]])
            for point in points
            if point.run == run
        }
        assert len(shared) == 1
    assert len({point.seed for point in points}) == 3


def test_unpaired_cells_share_nothing():
    points = plan(pair=False).points()
    assert len({point.seed for point in points}) == 12
    assert len({point.fields[SPEED] for point in points}) == 12


@pytest.mark.parametrize("pair", [True, False])
def test_more_runs_begin_with_the_same_ones(pair):
    few, many = plan(pair=pair), plan(pair=pair, runs=5)
    assert many.points()[:12] == few.points()


def test_a_draw_does_not_depend_on_other_fields():
    fewer = plan(draw={", ".join(X): PLAN["draw"][", ".join(X)]}, grid={})
    for alone in fewer.points():
        other = plan().points()[4 * alone.run]
        assert alone.fields[X[0]] == other.fields[X[0]]
        assert alone.seed == other.seed


def test_seed_changes_all_draws():
    for one, other in zip(plan().points(), plan(seed=5).points(), strict=True):
        assert one.seed != other.seed
        assert one.fields[SPEED] != other.fields[SPEED]


def test_redraws_leave_the_distribution_of_what_is_valid():
    # The robot's half length of 0.175 m and the box's half diagonal keep a box
    # with any heading off the start beyond 0.25 m on the x axis.
    path = "obstacles.0.waypoints_m.0.0"
    sweep = SweepPlan.model_validate(
        {
            "scenario": "default",
            "set": {"obstacles": [{"waypoints_m": [[2.0, 0.0]]}]},
            "draw": {path: {"uniform": [-1.0, 1.0]}},
            "runs": 400,
            "redraws": 20,
        }
    )
    points = sweep.points()
    places = np.array([point.fields[path] for point in points])
    assert np.all(np.abs(places) > 0.22)
    # 22.5 % of the draws stand on the start: 0.5 (0.35 + 0.1) of a range of 2.
    redraws = np.array([point.redraws for point in points])
    assert redraws.mean() == pytest.approx(0.225 / 0.775, abs=0.1)


def test_a_redraw_counts_for_all_cells_of_a_pair():
    path = "obstacles.0.waypoints_m.0.0"
    sweep = SweepPlan.model_validate(
        {
            "set": {"obstacles": [{"waypoints_m": [[2.0, 0.0]]}]},
            "grid": {"obstacles.0.size_m": [[0.1, 0.1], [1.0, 0.1]]},
            "draw": {path: {"uniform": [0.3, 1.0]}},
            "runs": 60,
            "redraws": 50,
        }
    )
    points = sweep.points()
    small = [point.fields[path] for point in points if point.cell == 0]
    large = [point.fields[path] for point in points if point.cell == 1]
    assert small == large
    assert min(small) >= 0.675


@settings(max_examples=30)
@given(
    value=st.floats(1e-12, 0.7) | st.integers(0, 1),
    text=st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), min_size=1),
)
def test_command_makes_the_same_scenario(tmp_path_factory, value, text):
    out = tmp_path_factory.mktemp("sweep")
    sweep = plan(
        set={"description": text}, grid={SPEED: [value], "name": [text]}, draw={}
    )
    base = scenario_from_mapping(sweep.base)
    (out / "scenario.yaml").write_text(dump_scenario(base), "utf-8")
    point = sweep.points()[1]
    words = shlex.split(reproducing_command(out, point, "drake"))
    assert words[:2] == ["phonotaxis", "simulate"]
    overrides = [words[k + 1] for k, word in enumerate(words) if word == "--set"]
    overrides.append(f"seed={words[words.index('--seed') + 1]}")
    assert load_scenario(words[2], overrides) == sweep.scenario_of(point)


def test_plan_survives_its_file(tmp_path):
    scenario = written(tmp_path / "mine.yaml", "duration_s: 5\n")
    file = written(tmp_path / "gains.yaml", "scenario: mine.yaml\nruns: 2\n")
    sweep = load_sweep(file)
    assert sweep.name == "gains"
    assert sweep.base["duration_s"] == 5.0
    other = tmp_path / "other"
    other.mkdir()
    (other / "scenario.yaml").write_text(
        dump_scenario(scenario_from_mapping(sweep.base)), "utf-8"
    )
    copy = load_sweep(written(other / "copy.yaml", dump_plan(sweep)))
    assert str(tmp_path) not in dump_plan(sweep)
    assert [x.fields for x in copy.points()] == [x.fields for x in sweep.points()]
    assert scenario_from_mapping(copy.base) == scenario_from_mapping(sweep.base)
    assert copy.model_copy(update={"name": "gains"}).digest == sweep.digest
    assert (
        plan().digest
        == load_sweep(written(other / "plan.yaml", dump_plan(plan()))).digest
    )
    digest = sweep.digest
    scenario.write_text("duration_s: 6\n")
    assert load_sweep(file).digest != digest


@pytest.mark.parametrize(
    ("changes", "field", "hint"),
    [
        ({"grid": {"law": []}}, "grid.law", "at least 1"),
        ({"grid": {"law": ["active", "active"]}}, "grid.law", "twice"),
        ({"grid": {"law": "active"}}, "grid.law", "list"),
        ({"grid": {"seed": [1, 2]}}, "grid.seed", "set the sweep's own seed"),
        ({"grid": {"law.": ["active"]}}, "grid.law.", "dotted path"),
        ({"set": {SPEED: 0.2}}, f"draw.{SPEED}", "overwrite"),
        ({"draw": {SPEED: {"uniform": [0, 1]}, "obstacles": {"choice": [[]]}}},
         "draw.obstacles", f"overwrite {SPEED}"),
        ({"draw": {SPEED: {"uniform": [1, 0]}}}, f"draw.{SPEED}.uniform", "low <"),
        ({"draw": {SPEED: {"normal": [0, 0]}}}, f"draw.{SPEED}.normal", "positive"),
        ({"draw": {SPEED: 3}}, f"draw.{SPEED}", "mapping"),
        ({"draw": {SPEED: {"uniform": [0.1, 0.2], "each": [[1, 0], [1, 0]]}}},
         f"draw.{SPEED}.each", "2 pairs for 1 paths"),
        ({"require": {"way_radius_m": 0}}, "require.way_radius_m", "greater"),
        ({"require": {"way_radios_m": 1}}, "require.way_radios_m", "way_radius_m"),
        ({"require": {"start_distance_m": 3}}, "require.start_distance_m", "redraws"),
        ({"runs": 0}, "runs", "greater"),
        ({"run": 5}, "run", "did you mean 'runs'"),
        ({"seed": -1}, "seed", "greater"),
        ({"scenario": "nowhere"}, "scenario", "phonotaxis scenarios"),
        ({"scenario": "nowhere.yaml"}, "scenario", "check the path"),
        ({"set": {"sourc.speed_m_s": 1}}, "sourc", "did you mean 'source'"),
        ({"grid": {"obstacles.7.speed_m_s": [1]}}, "obstacles.7", "count from 0"),
        ({"grid": {"source.speed_m_s": [0.2, -1]}}, "source.speed_m_s", "cell"),
        ({"draw": {"obstacles.7.speed_m_s": {"uniform": [0, 1]}}, "redraws": 9},
         "obstacles.7", "count from 0"),
        ({"draw": {X[0]: {"uniform": [-0.1, 0.1]}},
          "set": {"obstacles.0.waypoints_m.0.1": 0.0}}, "obstacles.0", "redraws"),
        ({"draw": {X[0]: {"uniform": [-0.1, 0.1]}}, "redraws": 3,
          "set": {"obstacles.0.waypoints_m.0.1": 0.0}}, "obstacles.0", "drawn 4 times"),
    ],
)  # fmt: skip
def test_bad_plan_is_refused(tmp_path, changes, field, hint):
    file = written(tmp_path / "sweep.yaml", json.dumps({**PLAN, **changes}))
    with pytest.raises(InputError) as caught:
        load_sweep(file).points()
    assert caught.value.field.startswith(field)
    assert hint in caught.value.message


def test_a_scenario_is_no_sweep(tmp_path):
    """One line names what to write; so does a field of the scenario in a sweep."""
    file = written(tmp_path / "mine.yaml", "duration_s: 5\nlaw: active\n")
    with pytest.raises(
        InputError, match=r"is a scenario; .*'scenario: mine.yaml'"
    ) as e:
        load_sweep(file)
    assert len(e.value.all) == 1
    file = written(tmp_path / "mine.yaml", "runs: 5\nlaw: active\n")
    with pytest.raises(InputError, match=r"law: .*write 'set: \{law: \.\.\.\}'"):
        load_sweep(file)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("runs: [", "YAML"),
        ("- a", "mapping"),
        ("runs: 1\nruns: 2", "duplicate"),
        ("set: {seed: 2001-01-01}", "set the sweep's own seed"),
        ("set: {name: 2001-01-01}", "plain|finite"),
        ("set: {duration_s: .nan}", "finite"),
    ],
)
def test_unreadable_file_is_refused(tmp_path, text, hint):
    with pytest.raises(InputError, match=hint):
        load_sweep(written(tmp_path / "sweep.yaml", text))
    with pytest.raises(InputError, match="give the path of a YAML file"):
        load_sweep(tmp_path / "missing.yaml")


def test_one_element_of_a_list_that_the_file_leaves_out():
    plan = SweepPlan(
        scenario="two_followers",
        set={"robots.near.start.position_m.1": 0.05},
        grid={"robots.near.start.position_m.0": (0.1, 0.2)},
    )
    starts = [plan.scenario_of(each).robots["near"].start for each in plan.points()]
    assert [each.position_m for each in starts] == [(0.1, 0.05), (0.2, 0.05)]
