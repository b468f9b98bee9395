"""Scenarios from YAML: every mistake names its field and its remedy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from hypothesis import given, strategies as st
from pydantic import BaseModel
from ruamel.yaml import YAML

from diagrams import load_scenario, simulate
from diagrams.scenario import participants
from diagrams.scenario.loading import dump_scenario, library_scenarios
from diagrams.scenario.participants import Follower
from diagrams.scenario.run_parameters import RunParameters
from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from diagrams.scenario.shorthand import joined
from systems.base.carrier_parameters import SourceRobotParameters
from systems.framework.input_error import InputError
from systems.framework.parameters import Parameters
from systems.sound.parameters import RoomParameters, SoundParameters
from tests.diagrams.scenario.kinds import KINDS

ONE_OF_EVERYTHING = """
name: one of everything
description: every field of the scenario's own level, and some of each block
tick_s: 0.0125
seed: 7
duration_s: 0.1
arena_m: [5, 6]
law: conventional
follows: source
loudspeaker: {start_s: 1}
hearing: ideal
obstacle_sensing: ideal
start: {position_m: [-1, 0.5], heading_deg: 10}
source: {waypoints_m: [[1, 0], [3, 0]], speed_m_s: 0.2, at_end: shuttle}
obstacles:
  - {name: box, size_m: [0.2, 0.1], waypoints_m: [[2, 2]], heading_deg: 45}
  - {name: cart, waypoints_m: [[3, 3], [3, -3]], speed_m_s: 0.1, start_time_s: 1}
stop: {goal_margin_m: 0.2, stuck_after_s: 5}
room: {size_m: [8, 8, 3], reverberation_time_s: 0.3}
sources: {source: {}, fan: {waypoints_m: [[0, 3]], sound: {kind: band_noise}}}
robots:
  robot: {obstacle_sensing: ultrasonic}
  second: {hearing: audio, obstacle_sensing: ultrasonic, start: {position_m: [-2, -1]}}
sound_speed_m_s: 346.5
assumed_sound_speed_m_s: 340
tracker: {hold: robot, maximum_age_s: 4}
ultrasonic: {noise_m: 0, firing: sequential}
collision_vector: {aggregation: sum, velocity_term: closing}
attraction: {follow_distance_m: 0.6, damping_n_s_m: 4}
laws: {conventional: {damping_n_s_m: 0.9}}
robot: {mass_kg: 5}
plant: {motor_lag_s: 0.1, slip: [0.1, 0], pulses_per_revolution: null}
guard: {wheel_error: 0.001, cell_m: 0.04}
integration_step_s: 0.005
faults: [{sensor: ultrasonic, number: 2, kind: noisy, start_s: 1}]
"""


def field_of(error: pytest.ExceptionInfo[InputError]) -> str:
    """The named field; asserts what holds for every message."""
    assert "\n" not in str(error.value), "one line"
    assert "pydantic" not in str(error.value)
    return error.value.field


def write(folder: Path, text: str) -> Path:
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_library_holds_the_papers_experiments():
    names = set(library_scenarios())
    assert {
        "default",
        "obstacle_free",
        "two_static_obstacles",
        "one_moving_obstacle",
        "two_moving_obstacles",
    } <= names


@pytest.mark.parametrize("name", sorted(library_scenarios()))
def test_library_loads_and_says_what_it_is(name):
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.description
    assert "\n" not in scenario.description


def untouched(model: Parameters) -> set[str]:
    """Fields that have the values of their defaults."""
    return {
        name
        for name, field in type(model).model_fields.items()
        if getattr(model, name) == field.default
    }


def test_one_of_everything_runs(tmp_path):
    scenario = load_scenario(write(tmp_path, ONE_OF_EVERYTHING))
    run, robot = untouched(scenario), untouched(scenario.of_robot("robot").follower)
    assert run == {
        "engine",
        "map",
        "odor",
        "radio",
        "reference_path_m",
        "wind",
        "world",
    }
    assert robot == {
        "blocks",
        "own_gains",
        "obstacle_sensing",
        "microphones",
        "tdoa",
    }
    assert simulate(scenario).simulated_s == pytest.approx(0.1)


def test_values_arrive(tmp_path):
    scenario = load_scenario(write(tmp_path, ONE_OF_EVERYTHING), ["seed=9"])
    assert scenario.seed == 9
    assert scenario.source.waypoints_m == ((1.0, 0.0), (3.0, 0.0))
    assert scenario.obstacles[1].name == "cart"
    for robot in scenario.robots.values():
        assert robot.plant.slip == (0.1, 0.0)


@pytest.mark.parametrize("name", sorted(library_scenarios()))
def test_dumped_scenario_loads_as_it_was(tmp_path, name):
    scenario = load_scenario(name, ["seed=3", "plant.slip=[0.01, 0.0]"])
    assert load_scenario(write(tmp_path, dump_scenario(scenario))) == scenario


def test_relative_files_lie_beside_the_scenario(tmp_path):
    text = """
sound: {kind: wav, file: a.wav}
microphones: {ego_noise_file: c.wav}
sources:
  source: {}
  fan: {sound: {kind: wav, file: b.wav}}
robots:
  robot: {}
  second: {start: {position_m: [-2, 0]}, loudspeaker: {kind: wav, file: d.wav}}
"""
    scenario = load_scenario(write(tmp_path, text))
    assert [
        scenario.source.sound.file,
        scenario.sources["fan"].sound.file,
        scenario.of_robot("robot").follower.microphones.ego_noise_file,
        scenario.sounds()["second"].file,
    ] == [str((tmp_path / f"{name}.wav").resolve()) for name in "abcd"]


def test_fields_of_a_group_that_is_unset_may_be_overridden(tmp_path):
    path = write(tmp_path, dump_scenario(Scenario()))
    scenario = load_scenario(path, ["room.reverberation_time_s=0.3"])
    assert scenario.room == RoomParameters(reverberation_time_s=0.3)


def test_a_dump_is_the_whole_scenario():
    data = YAML(typ="safe").load(dump_scenario(Scenario()))
    run, robot = set(RunParameters.model_fields), set(Follower.model_fields)
    assert set(data) == run | robot | {"source", "sound"}


def test_a_file_is_named_after_itself(tmp_path):
    assert load_scenario(write(tmp_path, "seed: 2")).name == "scene"


def test_an_empty_file_is_the_default_scenario(tmp_path):
    scenario = load_scenario(write(tmp_path, "# nothing\n"))
    assert scenario == Scenario(name="scene")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- 1\n- 2", "must hold a mapping of fields"),
        ("just text", "must hold a mapping of fields"),
        ("seed: 1\nseed: 2", "is not valid YAML.*seed"),
        ("start: {heading_deg: 1, heading_deg: 2}", "is not valid YAML.*heading_deg"),
        ("seed: [1", "is not valid YAML"),
    ],
)
def test_files_that_hold_no_scenario(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(InputError, match=message) as error:
        load_scenario(path)
    assert field_of(error) == str(path)


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError) as error:
        load_scenario(path)
    assert field_of(error) == str(path)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("obstacle_fre", "did you mean 'obstacle_free'"),
        ("no/such/file.yaml", "no file no/such/file.yaml; check the path"),
        ("", "is not known"),
    ],
)
def test_unknown_scenarios_say_where_the_known_are(source, message):
    with pytest.raises(InputError, match=message) as error:
        load_scenario(source)
    assert "phonotaxis scenarios" in error.value.message
    assert field_of(error) == "scenario"


@pytest.mark.parametrize(
    ("override", "field", "message"),
    [
        ("sead=2", "sead", "did you mean 'seed'"),
        ("source.sped_m_s=2", "source.sped_m_s", "did you mean 'source.speed_m_s'"),
        ("obstacles.0.sise_m=[1, 1]", "obstacles.0.sise_m", "not a field"),
        ("source.sound.kind=tone", "source.sound", "use sound"),
        ("zzzzz=2", "zzzzz", "not a field of a scenario; remove it"),
        (
            "robot.wheel_radius_m=-1",
            "robot.wheel_radius_m",
            "is -1; .*greater than",
        ),
        ("robot.mass_kg=heavy", "robot.mass_kg", "is 'heavy'; .*valid number"),
        ("robot.mass_kg=yes", "robot.mass_kg", "valid number"),
        ("robot=5", "robot", "is 5; "),
        ("duration_s=.nan", "duration_s", "finite"),
        ("duration_s=.inf", "duration_s", "finite"),
        ("seed=1.5", "seed", "valid integer"),
        ("hearing=ears", "hearing", "'audio', 'ideal' or 'ideal_always'"),
        ("tdoa.suppress_echoes=1", "tdoa.suppress_echoes", "valid boolean"),
        ("arena_m=[1]", "arena_m.1", "is missing; set it"),
        ("arena_m=[1, -1]", "arena_m.1", "greater than"),
        ("start.position_m=[0, .nan]", "start.position_m.1", "finite"),
        ("obstacles.0.waypoints_m=[[1, x]]", "obstacles.0.waypoints_m.0.1", "'x'"),
        ("obstacles.0.waypoints_m=[]", "obstacles.0.waypoints_m", "give at least one"),
        (
            "obstacles.0.waypoints_m=[[1, 1], [1, 1]]",
            "obstacles.0.waypoints_m",
            "remove one",
        ),
        ("obstacles.0.waypoints_m=[[0, 0]]", "obstacles.0", "is on.*move"),
        ("source.waypoints_m=[[0, 0]]", "source", "is on.*move"),
        ("obstacles.0.name=source", "obstacles", "'source' is taken; give"),
        (
            "ultrasonic.minimum_range_m=4",
            "ultrasonic.sensors.0.minimum_range_m",
            "below",
        ),
        (
            "laws.active.reference_stiffness_n_m=1",
            "laws.active.reference_stiffness_n_m",
            "above",
        ),
        ("sound_speed_m_s=20", "sound_speed_m_s", "50"),
        ("seed", "seed", "key=value"),
        ("=3", "=3", "key=value"),
        ("seed=[1", "seed", "is not valid YAML"),
        ("seed.x=1", "seed.x", "plain value; shorten"),
        ("seed.x.y=1", "seed.x", "plain value; shorten"),
        ("obstacles.1.name=a", "obstacles.1", "an index of a list of 1"),
        ("obstacles.x=1", "obstacles.x", "neither an index"),
    ],
)
def test_mistakes_name_the_whole_path(override, field, message):
    with pytest.raises(InputError, match=message) as error:
        load_scenario("default", ["seed=1", override])
    assert field_of(error) == field
    last = field.rpartition(".")[2] + ":"
    assert str(error.value).count(last) == 1, "the field is named once"


def test_overrides_reach_into_lists_and_make_maps():
    scenario = load_scenario(
        "default",
        ["obstacles.0.size_m=[0.3, 0.2]", "robot.mass_kg=5", "source.speed_m_s=0.1"],
    )
    assert scenario.obstacles[0].size_m == (0.3, 0.2)
    assert scenario.obstacles[0].name == "box"
    assert scenario.only.robot.mass_kg == 5.0
    assert scenario.source.speed_m_s == 0.1


def test_later_overrides_win():
    assert load_scenario("default", ["seed=2", "seed=3"]).seed == 3


def float_fields(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Paths of all fields that hold a number, in every block."""
    for name, info in model.model_fields.items():
        kinds = (info.annotation, *get_args(info.annotation))
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            yield from float_fields(info.annotation, f"{prefix}{name}.")
        elif float in kinds and get_origin(info.annotation) is not tuple:
            yield prefix + name


#: The kind of a robot, and a field of such a robot, of its run or of its source.
FLOAT_FIELDS = sorted(
    {("follower", path) for path in float_fields(RunParameters)}
    | {("follower", path) for path in float_fields(SourceRobotParameters, "source.")}
    | {("follower", path) for path in float_fields(SoundParameters, "sound.")}
    | {
        (kind, path)
        for kind in KINDS
        for path in float_fields(participants.KINDS[kind])
    }
)


def set_at(kind: str, path: str, value: Any) -> dict[str, Any]:
    *parents, last = path.split(".")
    data: dict[str, Any] = {last: value}
    for parent in reversed(parents):
        data = {parent: data}
    return joined(KINDS[kind], data)


def test_the_walk_finds_the_fields():
    assert {
        ("follower", "duration_s"),
        ("follower", "sound_speed_m_s"),
        ("follower", "sound.level_pa"),
        ("follower", "attraction.follow_distance_m"),
        ("follower", "laws.active.reference_stiffness_n_m"),
        ("router", "route.clearance_m"),
        ("odor_searcher", "search.wait_s"),
        ("sound_searcher", "robot.wheel_radius_m"),
    } <= set(FLOAT_FIELDS)
    assert len(FLOAT_FIELDS) > 150


@given(st.sampled_from(FLOAT_FIELDS), st.sampled_from([math.nan, math.inf, -math.inf]))
def test_no_number_may_be_nan_or_infinite(field, value):
    kind, path = field
    with pytest.raises(InputError) as error:
        scenario_from_mapping(set_at(kind, path, value))
    assert field_of(error) == path


@given(st.sampled_from(FLOAT_FIELDS), st.sampled_from(["1", True, [1.0], {}]))
def test_no_number_may_be_anything_else(field, value):
    kind, path = field
    with pytest.raises(InputError) as error:
        scenario_from_mapping(set_at(kind, path, value))
    assert field_of(error).startswith(path)


CARTS = "obstacles=[{name: box}, {name: cart, waypoints_m: [[3, 1], [3, -1]]}]"


def test_an_obstacle_is_set_by_its_name():
    scenario = load_scenario("default", [CARTS, "obstacles.cart.speed_m_s=0.2"])
    assert [each.speed_m_s for each in scenario.obstacles] == [0.3, 0.2]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ([CARTS, "obstacles.card.speed_m_s=1"], r"card' is neither .* use 'box', 'c"),
        ([CARTS, "obstacles.2.speed_m_s=1"], r"'2' is neither an index of a list of 2"),
        (
            ["obstacles=[{name: box}, {name: box}]", "obstacles.box.speed_m_s=1"],
            r"2 entries have the name 'box'; use an index",
        ),
    ],
)
def test_names_that_are_not_one_obstacle(settings, message):
    with pytest.raises(InputError, match=rf"^obstacles\.\w+: .*{message}"):
        load_scenario("default", settings)


@pytest.mark.parametrize("letter", ["\x1b", "\n", "\x07", "\u202e", "\u2028", "\x9b"])
def test_control_characters_in_names_are_refused(letter):
    """They would change a terminal, end a line, or reverse a text."""
    from analysis.batches.plan import SweepPlan

    bad = f"a{letter}b"
    for data in (
        {"name": bad},
        {"description": bad},
        {"obstacles": [{"name": bad, "waypoints_m": [[3.0, 1.0]]}]},
    ):
        with pytest.raises(InputError) as error:
            load_scenario(data)
        assert f"has the control character U+{ord(letter):04X}" in error.value.message
        assert field_of(error).endswith(("name", "description"))
    with pytest.raises(ValueError, match="control character"):
        SweepPlan(name=bad)
    assert load_scenario({"name": "\u00e9t\u00e9 \u0645 1"}).name


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("sweep.yaml", r"runs of a sweep; .*scenario\.yaml is the scenario"),
        ("recommended.yaml", r"simulate .*recommended\.yaml or .*scenario\.yaml"),
    ],
)
def test_results_of_many_runs_are_no_scenario(tmp_path, file, message):
    (tmp_path / "scenario.yaml").write_text("seed: 3\n")
    assert load_scenario(tmp_path).seed == 3
    (tmp_path / file).touch()
    with pytest.raises(InputError, match=message):
        load_scenario(tmp_path)
