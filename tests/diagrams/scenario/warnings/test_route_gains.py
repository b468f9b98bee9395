"""Gains beyond what sampling permits are told before a run, with the bound."""

from __future__ import annotations

import numpy as np
import pytest

import phonotaxis
from analysis.loops.contact_mode import largest_contact_stiffness
from analysis.routes.adaptation_stability import swinging_target
from analysis.routes.point_run import PointLoop, run_point
from diagrams import load_scenario
from diagrams.scenario.warnings.warnings_of import warnings_of
from systems.laws.trajectory.impedance_adaptation import (
    DAMPING_BOX_N_S_M,
    STIFFNESS_BOX_N_M,
)

ADAPTIVE = "laws.trajectory_adaptive"
IMPEDANCE = "impedance"


def all_warnings(law, *fields):
    scenario = load_scenario("unknown_block", [f"law=trajectory_{law}", *fields])
    return [str(each) for each in warnings_of(scenario)]


def warnings(law, *fields):
    """All but those on the safety term of the adaptation."""
    found = all_warnings(law, *fields)
    return [each for each in found if "safety term" not in each]


@pytest.mark.parametrize("law", ["conventional", "adaptive", "filtered"])
def test_the_laws_as_they_are_need_no_warning_of_their_gains(law):
    assert warnings(law) == []


SENSITIVITY = f"{ADAPTIVE}.rule=sensitivity"
PENALTY = f"{ADAPTIVE}.penalty=3"


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ([], "adaptation has no safety term, and such a robot collides more often"),
        ([SENSITIVITY], "adaptation has no safety term"),
        ([PENALTY], "penalty: is 3, but rule lyapunov has no safety term"),
        ([SENSITIVITY, PENALTY], None),
        ([f"{ADAPTIVE}.rate=0"], None),
        ([f"{ADAPTIVE}.safety_filter=true"], None),
        ([f"{IMPEDANCE}.block_distance_m=0.2"], None),
    ],
)
def test_adaptation_without_its_safety_term_is_told(fields, told):
    found = all_warnings("adaptive", *fields)
    if told is None:
        assert found == []
        return
    (warning,) = found
    assert warning.startswith(f"{ADAPTIVE}.penalty")
    assert told in warning


def test_a_block_distance_within_the_body_is_told():
    """A TurtleBot3 Burger, 138 x 178 mm: its rear corners are farthest from P."""
    corners = [(x, y) for x in (-0.069, 0.069) for y in (-0.089, 0.089)]
    reach = max(np.hypot(x - 0.08, y) for x, y in corners)
    field = f"{IMPEDANCE}.block_distance_m"
    assert warnings("conventional", f"{field}={reach + 1e-6}") == []
    (warning,) = warnings("conventional", f"{field}={reach - 1e-6}")
    assert warning.startswith(f"{field}: is 0.1735")
    assert "the body reaches 0.174 m from P" in warning


@pytest.mark.parametrize(
    ("law", "fields", "parts"),
    [
        # D T/M = 2, and K at D = 4 with motors of 50 ms.
        (
            "filtered",
            [f"{IMPEDANCE}.damping_n_s_m=80"],
            ["damping_n_s_m: is 80", "80,"],
        ),
        (
            "filtered",
            [f"{IMPEDANCE}.stiffness_n_m=97"],
            [".stiffness_n_m: is 97 N/m", "from 96.4 on"],
        ),
        (
            "filtered",
            [f"{IMPEDANCE}.contact_stiffness_n_m=94"],
            ["contact_stiffness_n_m: and stiffness_n_m together are 97", "96.4"],
        ),
        # 4 + 7 * 10 < 80 < 4 + 8 * 10.
        (
            "filtered",
            [f"{IMPEDANCE}.contact_damping_n_s_m=10"],
            ["more than 7 contacts"],
        ),
        (
            "adaptive",
            [f"{ADAPTIVE}.rate=1e5"],
            ["rate: is 100000", "1.6e+03"],
        ),
        # The lag at which K = 3 pulls through K_e S = 1.5 is half a meter.
        (
            "adaptive",
            [
                f"{ADAPTIVE}.rate=1e4",
                f"{IMPEDANCE}.contact_stiffness_n_m=1.5",
            ],
            ["6.4e+03", "0.5 m"],
        ),
    ],
)
def test_a_bound_that_is_passed_is_named(law, fields, parts):
    (warning,) = warnings(law, *fields)
    assert warning.startswith(ADAPTIVE if law == "adaptive" else IMPEDANCE)
    for part in parts:
        assert part in warning


@pytest.mark.parametrize("cure", ["projected=true", "rate=1500"])
def test_what_is_bounded_or_slow_needs_none(cure):
    fields = f"{ADAPTIVE}.rate=1e5", f"{ADAPTIVE}.{cure}"
    assert warnings("adaptive", *fields) == []


def test_the_box_is_held_against_what_its_least_damping_stands():
    """By the plant as Drake linearizes it, D = 3: limits need no warning."""
    bound = largest_contact_stiffness(
        load_scenario("unknown_block"), damping_n_s_m=DAMPING_BOX_N_S_M[0]
    )
    assert STIFFNESS_BOX_N_M[1] < 0.1 * bound


def test_what_is_warned_of_leaves_all_that_is_stable():
    """At the amplitude that it names: D beyond 2 M/T, and below the bound not."""
    own = load_scenario(
        "unknown_block",
        ["law=trajectory_adaptive", f"{ADAPTIVE}.rate=5000"],
    ).router.gains
    loop = PointLoop(own, motor_lag_s=0.05)
    targets = swinging_target(1.0, 60.0, 0.025)
    assert np.abs(run_point(loop, targets).gains[:, 1]).max() > 80.0
    slower = loop._replace(law=own.model_copy(update={"rate": 1500.0}))
    assert np.abs(run_point(slower, targets).gains[:, 1]).max() < 80.0


def test_each_robot_is_named():
    field = f"robots.second.{IMPEDANCE}.damping_n_s_m"
    (warning,) = warnings_of(load_scenario("robots_2", [f"{field}=90"]))
    assert str(warning).startswith(f"{field}: is 90")


def test_the_command_tells_it_before_it_runs(capsys, tmp_path):
    field = f"{IMPEDANCE}.damping_n_s_m"
    words = ["simulate", "unknown_block", "--set", f"{field}=90", "--set"]
    phonotaxis.main([*words, "duration_s=0.1", "--out", str(tmp_path / "out")])
    assert capsys.readouterr().err.startswith(f"phonotaxis: {field}: is 90")


BESIDE: dict[str, object] = {
    "robot.preset": "turtlebot3_burger",
    "obstacle_sensing": "ideal",
    "route": {"goal_m": [3.0, 0.0]},
    "stop.goal_margin_m": 0.1,
    "start.position_m": [0.0, 0.0],
    "start.heading_deg": 0.0,
}


#: The wall is not on the map, and the robot does not plan again.
STAYS: dict[str, object] = {
    "obstacles.0.known": False,
    "route": {"goal_m": [3.0, 0.0], "replan": False},
}


def beside(law: str, gap: float, **fields: object):
    """A known wall at a gap from the goal, 0.1 m thick."""
    wall = {
        "name": "wall",
        "waypoints_m": [[1.5, -gap - 0.05]],
        "size_m": [5.0, 0.1],
        "known": True,
    }
    changes = {**BESIDE, "law": f"trajectory_{law}", "obstacles": [wall], **fields}
    return load_scenario("unknown_block", changes)


def told(scenario):
    return [str(each) for each in warnings_of(scenario)]


@pytest.mark.parametrize(
    ("law", "last"),
    # By hand: S - margin (K + K_e)/K_e.
    [("filtered", 0.8 - 0.1 * 11 / 8), ("conventional", 1.0 - 0.1 * 6 / 3)],
)
def test_a_goal_too_near_to_a_wall_is_told(law, last):
    near, far = (told(beside(law, last + step, **STAYS)) for step in (-0.01, 0.01))
    assert far == []
    assert len(near) == 1
    assert "route.goal_m: 'wall' will hold P 0.1" in near[0]
    assert f"{last:.2g} m away from it is enough" in near[0]


@pytest.mark.parametrize("law", ["filtered", "conventional"])
def test_a_robot_stops_where_the_warning_says(law):
    """0.5 m from a wall: (S - b) K_e/(K + K_e), 0.218 m of the filtered law."""
    scenario = beside(law, 0.5, engine="compiled", **STAYS)
    (warning,) = told(scenario)
    expected = {"filtered": 0.3 * 8 / 11, "conventional": 0.5 * 3 / 6}[law]
    assert f"hold P {expected:.2g} m off" in warning
    result = phonotaxis.simulate(scenario)
    assert result.cause == "stuck"
    x, y = (result.columns[f"p_WP_{axis}"][-1] for axis in "xy")
    assert np.hypot(x - 3.0, y) == pytest.approx(expected, abs=0.01)


def test_pushes_of_several_walls_are_added():
    """Between walls 0.5 m off on both sides P rests at its goal. With one ahead, too,
    it does not: that one pushes it back, and the others stay as far."""
    walls = [
        {"waypoints_m": [[1.5, y]], "size_m": [5.0, 0.1], "name": f"wall {y}"}
        for y in (-0.55, 0.55)
    ]
    assert told(beside("conventional", 0.5, obstacles=walls)) == []
    ahead = {"waypoints_m": [[3.55, 0.0]], "size_m": [0.1, 0.2], "name": "ahead"}
    (warning,) = told(beside("conventional", 0.5, obstacles=[*walls, ahead]))
    assert "'ahead' will hold P 0.25 m off the goal" in warning
