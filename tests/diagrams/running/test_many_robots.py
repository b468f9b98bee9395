"""Several robots and sources in one world: what each sees, hears, hits and follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams import RunResult, Scenario, load_scenario, simulate
from diagrams.building.builder import build_sound_follower
from diagrams.building.robot import make_robot
from diagrams.scenario.participants import Follower
from diagrams.scenario.scenario import scenario_from_mapping
from systems.framework.input_error import InputError
from systems.hearing.tdoa_estimator import may_sound
from systems.sound.parameters import SoundParameters

pytestmark = pytest.mark.drake

#: No noise whose seed would depend on the robot's name.
EXACT: dict[str, Any] = {
    "hearing": "ideal",
    "ultrasonic": {"noise_m": 0.0},
    "duration_s": 6.0,
}
WAITING: dict[str, Any] = {"law": "none", "attraction": {"stiffness_n_m": 0.0}}

DRIVING = """
from pydrake.systems.framework import LeafSystem


class Ahead(LeafSystem):
    def __init__(self, robot, attraction, laws):
        super().__init__()
        self.set_name("ahead")
        self.DeclareVectorOutputPort(
            "twist_B", 2, lambda context, output: output.SetFromVector([0.3, 0.0])
        )
"""


def run(**data: Any) -> RunResult:
    return simulate(scenario_from_mapping(EXACT | data))


@pytest.fixture
def driving(tmp_path: Path) -> str:
    """A law that drives ahead at 0.3 m/s, whatever it senses, and tells no forces."""
    path = tmp_path / "driving.py"
    path.write_text(DRIVING)
    return f"{path}:Ahead"


def test_robots_that_are_far_apart_do_as_if_alone():
    """To the last bit: nothing of one robot or source gets into another."""
    shifted = {"waypoints_m": [[2.0, 50.0], [5.0, 51.0]]}
    both = run(
        robots={
            "here": {"follows": "near"},
            "there": {
                "start": {"position_m": [0.0, 50.0]},
                "law": "conventional",
                "follows": "far",
            },
        },
        sources={"near": {"waypoints_m": [[2.0, 0.5], [4.0, 0.0]]}, "far": shifted},
    )
    here = run(source={"waypoints_m": [[2.0, 0.5], [4.0, 0.0]]})
    there = run(start={"position_m": [0.0, 50.0]}, law="conventional", source=shifted)
    for name, alone in (("here", here), ("there", there)):
        assert both.robots[name].columns.keys() == alone.columns.keys()
        for key, values in alone.columns.items():
            np.testing.assert_array_equal(both.robots[name].columns[key], values, key)
            if key != "t":
                np.testing.assert_array_equal(both.columns[f"{name}.{key}"], values)


def test_each_robot_has_noise_of_its_own():
    """Two of a kind in two places of a kind: the same but for the noise of 1 mm."""
    box = {"size_m": [0.2, 2.0]}
    result = run(
        **WAITING,
        ultrasonic={},
        robots={"a": {}, "b": {"start": {"position_m": [0.0, 50.0]}}},
        obstacles=[
            box | {"name": "one", "waypoints_m": [[1.2, 0.0]]},
            box | {"name": "two", "waypoints_m": [[1.2, 50.0]]},
        ],
        source={"waypoints_m": [[0.0, 9.0]]},
        stop={"diverged_range_m": 90.0},
        duration_s=1.0,
    )
    a, b = (own.columns["range_2"] for own in result.robots.values())
    assert np.std(a - b) == pytest.approx(1e-3 * np.sqrt(2.0), rel=0.5)


def test_a_robot_is_seen_by_another():
    """By the middle cone, at 3 m less half a robot: P is on the front face."""
    result = run(
        **WAITING,
        robots={"a": {}, "b": {"start": {"position_m": [2.0, 0.0], "heading_deg": 90}}},
        source={"waypoints_m": [[0.0, 4.0]]},
        duration_s=0.2,
    )
    a = result.robots["a"]
    # Turned by a quarter, b shows its broad side: half its width is toward a.
    assert a.columns["range_2"] == pytest.approx(2.0 - 0.175 - 0.41)
    assert set(a.surroundings.bodies) == {"b", "source"}


def test_two_robots_meet_where_and_when_they_must(driving):
    """Head on from 2 m at 0.3 m/s each: after 1.65 m / 0.6 m/s, and the motors' lag."""
    result = run(
        law=driving,
        robots={
            "east": {},
            "west": {"start": {"position_m": [2.0, 0.0], "heading_deg": 180.0}},
            "aside": {"start": {"position_m": [0.0, -8.0]}},
        },
        source={"waypoints_m": [[0.0, 9.0]]},
        duration_s=10.0,
    )
    met = 1.65 / 0.6 + 0.05
    for name, other in (("east", "west"), ("west", "east")):
        hit = result.robots[name].collision
        assert hit is not None
        assert hit.object == other
        assert hit.time == pytest.approx(met, abs=0.01)
    assert result.cause == "collision"
    assert result.name == "east"
    assert result.robots["aside"].cause == "interrupted"
    assert result.robots["aside"].collision is None


def test_a_law_without_forces_is_logged_without_them(driving):
    result = run(law=driving, duration_s=0.5)
    assert "repulsion_x" not in result.columns
    assert result.columns["wheel_speed_left"][-1] == pytest.approx(0.3 / 0.06)


def test_each_robot_has_an_end_of_its_own():
    """One rests in its goal, while another is still on its way."""
    damped = {"stiffness_n_m": 8.4, "damping_n_s_m": 8.4}
    result = run(
        attraction=damped,
        robots={
            "near": {},
            "late": {"start": {"position_m": [-9.0, 6.0]}, "attraction": damped},
        },
        source={"waypoints_m": [[2.5, 0.3]]},
        duration_s=12.0,
    )
    assert result.robots["near"].cause == "reached"
    assert result.robots["late"].cause == "timeout"
    assert result.cause == "timeout"
    assert result.name == "late"
    assert result.simulated_s == pytest.approx(12.0)


@pytest.fixture(scope="module")
def convoy() -> RunResult:
    return simulate(load_scenario("convoy", ["duration_s=12"]))


def test_a_robot_is_heard_by_its_follower(convoy):
    """With full audio, and its own loudspeaker beside its own microphones."""
    for name, other in (("leader", "source"), ("second", "leader")):
        own = convoy.robots[name]
        columns = own.columns
        heard = np.r_[False, columns["detected"][:-1] > 0.5] & (own.time > 0.1)
        assert own.surroundings.target == other
        off = np.hypot(
            columns["p_WS_estimated_x"] - columns["p_WS_x"],
            columns["p_WS_estimated_y"] - columns["p_WS_y"],
        )[heard]
        assert len(off) > 100
        assert np.quantile(off, 0.99) < 0.1, "the others are more than 1 m from there"
        assert own.cause == "completed"


def test_what_is_followed_is_where_the_leader_was(convoy):
    leader, second = convoy.robots["leader"], convoy.robots["second"]
    np.testing.assert_array_equal(second.poses("WS"), leader.poses("WB"))
    path = second.surroundings.followed.path
    between = 0.5 * (leader.poses("WB")[100] + leader.poses("WB")[101])
    assert path.pose(100.5 * 0.025) == pytest.approx(tuple(between))
    assert second.target_moves


def test_without_its_schedule_a_follower_takes_one_for_the_other(convoy):
    """What ``schedule_known`` is for: both sound alike."""
    lost = simulate(
        load_scenario("convoy", ["duration_s=4", "tdoa.schedule_known=false"])
    )
    columns = lost.robots["second"].columns
    heard = np.r_[False, columns["detected"][:-1] > 0.5]
    to_source = np.hypot(
        columns["p_WS_estimated_x"] - lost.robots["leader"].columns["p_WS_x"],
        columns["p_WS_estimated_y"] - lost.robots["leader"].columns["p_WS_y"],
    )
    assert np.any(to_source[heard] < 0.2)


@pytest.mark.parametrize(
    ("time", "may"),
    [
        (0.0, False),
        (1.0, False),
        (1.025, True),
        (1.5, True),
        (1.62, True),
        (1.63, False),
        (3.0, False),
        (3.025, True),
    ],
)
def test_frames_that_can_hold_the_sound(time, may):
    """Bursts of 0.5 s from 1 s on, a way of 0.1 s, frames of 25 ms."""
    sound = SoundParameters(start_s=1.0)
    assert may_sound(sound, time, 0.1, 0.025) is may


def test_both_followers_of_one_source_complete():
    result = simulate(load_scenario("two_followers"))
    assert {own.cause for own in result.robots.values()} == {"completed"}
    assert result.cause == "completed"


def test_a_robot_alone_has_ports_to_be_wired_by_hand():
    scenario = Scenario.model_validate({"loudspeaker": {}})
    robot = make_robot(scenario, "mine", owners=(0, 1), others=["radio"])
    inputs = {
        robot.get_input_port(k).get_name(): robot.get_input_port(k)
        for k in range(robot.num_input_ports())
    }
    assert set(inputs) == {
        "emission",
        "emission_radio",
        "pose_WS",
        "poses_WO",
        "sizes",
    }
    assert inputs["poses_WO"].size() == 6
    outputs = [robot.get_output_port(k) for k in range(robot.num_output_ports())]
    names = [port.get_name() for port in outputs]
    shown = ["echo", "p_WS_estimated", "target_valid"]
    assert names == ["pose_WB", "velocity_WB", *shown, "own_emission"]
    assert robot.get_name() == "mine"


def test_one_robots_settings_do_not_touch_another_and_follow_the_scenarios():
    data = {
        "law": "conventional",
        "attraction": {"follow_distance_m": 0.9},
        "robots": {
            "a": {"start": {"position_m": [0, 5]}},
            "b": {"law": "none", "attraction": {"damping_n_s_m": 3.0}},
        },
    }
    scenario = scenario_from_mapping(data)
    a, b = scenario.robots["a"], scenario.robots["b"]
    assert isinstance(a, Follower)
    assert isinstance(b, Follower)
    assert (a.law, b.law) == ("conventional", "none")
    assert a.attraction.damping_n_s_m == 1.0
    assert b.attraction.damping_n_s_m == 3.0
    assert a.attraction.follow_distance_m == b.attraction.follow_distance_m == 0.9
    assert a.start.position_m == (0.0, 5.0)
    other = scenario_from_mapping(data | {"law": "active"})
    assert (other.robots["a"].law, other.robots["b"].law) == ("active", "none")


def test_parts_are_asked_for_by_name_where_there_are_several():
    follower = build_sound_follower(load_scenario("two_followers", ["hearing=ideal"]))
    with pytest.raises(InputError, match=r"robots: there are 2: near, far; select"):
        follower.port("plant", "pose_WB")
    assert follower.robots["far"].port("plant", "pose_WB").size() == 3


PAIR = "robots={a: {}, b: {start: {position_m: [-2, 0]}}}"


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ["robots={a: {}, b: {}}"],
            r"robots\.b\.start\.position_m: robot 'b' at .* overlaps robot 'a'; move",
        ),
        (
            ["robots={a: {}}", "sources={a: {}}"],
            r"sources: the name 'a' is taken; give each",
        ),
        (
            [PAIR, "obstacles=[{name: b}]"],
            r"obstacles: the name 'b' is taken; give each",
        ),
        (["robots={A b: {}}"], r"robots\.A b: is 'A b'; string should match"),
        # Files of the run are named after it.
        ([f"robots={{{'x' * 65}: {{}}}}"], r"robots\.x+: .*at most 64 characters"),
        (
            [PAIR, "robots.b.lawn=none"],
            r"robots\.b\.lawn: did you mean 'robots\.b\.law'",
        ),
        ([PAIR, "robots.b.law=3"], r"robots\.b\.law: is 3; input should be a valid"),
        (
            [PAIR, "robots.b.attraction.stiffness_n_m=-1"],
            r"robots\.b\.attraction\.stiffness_n_m: is -1",
        ),
        ([PAIR, "robots.b.follows=c"], r"robots\.b\.follows: 'c' is neither .*use "),
        ([PAIR, "robots.b.follows=a"], r"robots\.b\.follows: 'a' is neither "),
        (["follows=robot"], r"follows: 'robot' is neither a source .*use source"),
        (
            [PAIR, "robots.a.follows=b", "robots.b.follows=a"],
            r"robots\.a\.follows: 'b' is neither .*; add a source, or a loudspeaker$",
        ),
        (
            ["sources={s: {body: false}}"],
            r"sources\.s\.body: is off, but robot 'robot' follows it",
        ),
        (
            ["hearing=ideal", "sources={s: {}, t: {waypoints_m: [[0, 3]]}}"],
            r"sources\.t: no robot hears its sound: no robot follows it",
        ),
        (
            ["hearing=ideal", PAIR, "robots.b.loudspeaker={}"],
            r"robots\.b\.loudspeaker: no robot hears its sound",
        ),
        (
            ["hearing=ideal", "loudspeaker={}"],
            r"loudspeaker: no robot hears its sound",
        ),
        (
            ["tdoa.schedule_known=true", "sound.on_s=2", "sound.period_s=2"],
            r"tdoa\.schedule_known: 'source' sounds without a pause",
        ),
        (
            [PAIR, "robots.b.plant.motor_lag_s=0.001"],
            r"robots\.b\.plant\.motor_lag_s: 0\.001 s is too short",
        ),
        (
            [PAIR, "room={size_m: [12, 12, 3]}", "robots.b.start.position_m=[-9, 0]"],
            r"robots\.b\.start\.position_m: .* is outside the room",
        ),
        (
            [PAIR, "source.waypoints_m=[[-2, 0]]"],
            r"source: 'source' is on .* \(-2\.0, 0\.0\); .* robots\.b\.start\.",
        ),
    ],
)
def test_bad_input_names_the_robot(overrides, message):
    with pytest.raises(InputError, match=rf"^{message}") as error:
        load_scenario("default", overrides)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) <= 300


def test_two_robots_may_follow_each_other_past_a_silent_source():
    """It is there in every scenario, and no fault where nobody listens to it."""
    each = "{loudspeaker: {}, follows: %s, start: {position_m: [%d, 0]}}"
    pair = f"robots={{a: {each % ('b', 0)}, b: {each % ('a', -3)}}}"
    assert set(load_scenario("default", ["hearing=ideal", pair]).robots) == {"a", "b"}


def test_two_robots_of_one_name_are_refused(tmp_path):
    path = tmp_path / "twice.yaml"
    path.write_text("robots:\n  a: {}\n  a: {start: {position_m: [3, 3]}}\n")
    with pytest.raises(InputError, match=r"twice\.yaml: .*duplicate key \"a\""):
        load_scenario(path)
