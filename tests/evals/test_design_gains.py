"""The designed gains in the diagram: the barrier holds, and not by luck."""

from __future__ import annotations

import json

import numpy as np
import pytest

from analysis.batches.comparison_plans import comparison_plan
from analysis.loops.push_and_pull import DESIGNED_LAWS
from analysis.stability.requirements import Requirements, meters_to_go
from diagrams import load_scenario, simulate
from diagrams.scenario.scenario import Scenario
from phonotaxis import main

pytestmark = pytest.mark.slow

WALL_X = 2.5
#: Fields that a law's push is proportional to.
SPRINGS = {
    "conventional": ("stiffness_n_m",),
    "active": ("reference_stiffness_n_m", "matched_stiffness_n_m"),
    "conventional2017": ("distance_gain_j",),
    "active2017": ("distance_gain_j",),
}


def run_at_wall(law: str, share: float):
    """Head-on at a wall, the target as far behind it as the design allows for."""
    gains = getattr(Scenario().follower.laws, law).model_dump()
    for field in SPRINGS[law]:
        gains[field] *= share
    to_go = meters_to_go(Scenario(), Requirements())
    source = WALL_X + to_go + Scenario().follower.attraction.follow_distance_m
    return simulate(
        Scenario.model_validate(
            {
                "law": law,
                "hearing": "ideal_always",
                "obstacle_sensing": "ideal",
                "plant": {"pulses_per_revolution": None},
                "duration_s": 15.0,
                "source": {"waypoints_m": [[source, 0.0]]},
                "obstacles": [
                    {"waypoints_m": [[WALL_X + 0.05, 0.0]], "size_m": [0.1, 3.0]}
                ],
                "laws": {law: gains},
            }
        )
    )


@pytest.mark.parametrize("law", DESIGNED_LAWS)
def test_P_stops_before_a_wall(law):
    run = run_at_wall(law, share=1.0)
    speed = np.hypot(run.columns["v_WB_x"], run.columns["v_WB_y"])
    assert speed.max() == pytest.approx(0.72, abs=1e-6), "it must come at top speed"
    assert run.cause == "timeout"
    ahead = run.columns["p_WB_x"] + 0.175 * np.cos(run.columns["theta_WB"])
    clearance = WALL_X - ahead.max()
    # Its push is steepest at 3 cm: a tick of 25 ms and the motors' lag cost 1 cm.
    least = 0.015 if law == "conventional2017" else 0.03
    assert clearance > least


@pytest.mark.parametrize("law", DESIGNED_LAWS)
def test_a_fifth_less_does_not_stop_it(law):
    run = run_at_wall(law, share=0.8)
    assert run.cause == "collision"


@pytest.mark.long
def test_command_derives_the_defaults(tmp_path, capsys):
    out = tmp_path / "design"
    assert main(["design", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    contact = [line for line in text.splitlines() if "contact stiffness" in line]
    assert [line.endswith("not met") for line in contact] == [
        *(True, False, True, True),
        *(False, False, True, True),
    ]
    summary = json.loads((out / "summary.json").read_text("utf-8"))
    laws = {law["law"]: law for law in summary["today"]["laws"]}
    for law in DESIGNED_LAWS:
        assert laws[law]["gains"] == getattr(Scenario().follower.laws, law).model_dump()
    assert all(runs["jams"] == 0 for runs in summary["today"]["jams"])
    better = summary["recommended"]
    assert [law["acceptable"] for law in better["laws"]] == [True, True, False, False]
    assert better["figures"]["damping_ratio"] >= 0.4
    assert better["figures"] == summary["gains"]["recommended"]
    assert_layouts_have_the_gains_of(load_scenario(out / "recommended.yaml"))
    assert {path.name for path in out.iterdir()} == {
        "summary.json",
        "scenario.yaml",
        "recommended.yaml",
        "design.png",
        "law_curves.png",
    }


def assert_layouts_have_the_gains_of(recommended: Scenario) -> None:
    """Limits and saturations of two_static_obstacles stay its own."""
    plan = comparison_plan("two_static_obstacles_recommended", runs=1)
    scenario = plan.scenario_of(plan.points()[0])
    assert scenario.follower.attraction == recommended.follower.attraction
    own = load_scenario("two_static_obstacles").follower.laws
    for law in DESIGNED_LAWS:
        printed = getattr(Scenario().follower.laws, law).model_dump()
        kept = {
            field: value
            for field, value in getattr(own, law).model_dump().items()
            if value != printed[field]
        }
        designed = getattr(recommended.follower.laws, law).model_dump() | kept
        assert getattr(scenario.follower.laws, law).model_dump() == designed


def test_command_refuses_what_cannot_be_designed(tmp_path, capsys):
    words = ["design", "--set", "attraction.follow_distance_m=3.5"]
    assert main([*words, "--out", str(tmp_path / "x")]) == 2
    assert "attraction.follow_distance_m: 3.5 m" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("law", ["conventional", "active"])
def test_the_recommended_attraction_rests_inside_the_goal(law):
    """Pushed off the master robot: without the reserve it rested 2 cm outside."""
    plan = comparison_plan("two_static_obstacles_recommended", runs=1)
    layout = plan.scenario_of(plan.points()[0])
    changes = {"law": law, "hearing": "ideal", "obstacles": [], "duration_s": 20.0}
    run = simulate(Scenario.model_validate(layout.model_dump() | changes))
    assert run.cause == "reached"
    distance = run.columns["source_range_true"][-1]
    assert distance < layout.goal_radius_m - 0.05
