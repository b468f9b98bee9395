"""A goal is a point without a body, at any distance."""

from __future__ import annotations

import numpy as np
import pytest

from diagrams import load_scenario, simulate
from diagrams.scenario.run_parameters import StopParameters
from systems.framework.input_error import InputError

FAR = {"goal_m": [45.0, 20.0], "law": "conventional", "duration_s": 100}


def test_the_field_stands_for_a_source_without_a_body():
    written = {
        "hearing": "ideal_always",
        "attraction": {"follow_distance_m": 0.0},
        "source": {"waypoints_m": [[6.0, 1.0]], "body": False},
    }
    goal = load_scenario({"goal_m": [6, 1], "law": "dwa"})
    assert goal == load_scenario({**written, "law": "dwa"})
    assert goal == load_scenario("default").with_(
        goal_m=[6, 1], law="dwa", name="scenario", description="", obstacles=[]
    )
    assert list(goal.surroundings().bodies) == []


@pytest.mark.parametrize("sensing", ["ultrasonic", "ideal"])
def test_the_robot_drives_onto_a_far_goal_and_senses_nothing(sensing):
    """P rests on the point, so that the body covers it, and no push was felt."""
    far = {**FAR, "engine": "compiled", "obstacle_sensing": sensing}
    run = simulate(load_scenario(far))
    assert (run.cause, run.collision) == ("reached", None)
    assert run.columns["source_range_true"][-1] <= 0.3
    for name in ("repulsion_x", "repulsion_y"):
        assert not run.columns[name].any()


@pytest.mark.parametrize("sensing", ["ultrasonic", "ideal"])
def test_both_engines_agree(sensing):
    near = {**FAR, "goal_m": [1.0, 0.5], "duration_s": 4, "obstacle_sensing": sensing}
    drake, compiled = (
        simulate(load_scenario({**near, "engine": engine}))
        for engine in ("drake", "compiled")
    )
    for name, column in drake.columns.items():
        np.testing.assert_allclose(compiled.columns[name], column, atol=1e-9)


@pytest.mark.parametrize(
    ("given", "start_m", "range_m"),
    [(None, 3.0, 20.0), (None, 20.0, 20.0), (None, 49.0, 98.0), (25.0, 49.0, 25.0)],
)
def test_a_run_diverges_at_twice_the_distance_of_a_far_start(given, start_m, range_m):
    stop = StopParameters(diverged_range_m=given).for_start(start_m)
    assert stop.diverged_range_m == range_m


def test_for_a_route_it_is_the_goal_of_the_route():
    fields = {"law": "trajectory_filtered", "route": {"clearance_m": 0.5}}
    assert load_scenario({**fields, "goal_m": [60, 0]}).router.route.goal_m == (60, 0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"goal_m": 3}, r"^goal_m: "),
        ({"goal_m": [1, 2, 3]}, r"^goal_m"),
        ({"goal_m": [1, 2], "sources": {"a": {}}}, r"^goal_m: cannot hold together"),
        ({"source": {"body": False}}, r"^source.body: is off, but .* ideal_always"),
    ],
)
def test_faults_name_the_field(fields, message):
    with pytest.raises(InputError, match=message):
        load_scenario(fields)
