"""Fields of the previous version are accepted, or the message names their successor."""

from __future__ import annotations

import pytest

from diagrams import load_scenario
from diagrams.scenario.fields.field_list import list_fields
from diagrams.scenario.fields.shipped import scenario_schema
from diagrams.scenario.former_fields import former_fields
from diagrams.scenario.participants import Follower
from systems.framework.input_error import InputError

PATHS = {field.path for field in list_fields(scenario_schema())}


def test_every_new_name_is_a_field():
    new = {former.new for former in former_fields() if former.new}
    assert len(new) > 10
    assert new - PATHS - {"ultrasonic.sensors"} == set()


def test_no_former_name_is_a_field():
    assert {former.path for former in former_fields()} & PATHS == set()


def test_a_former_file_gives_the_same_scenario(tmp_path):
    """The same settings by their names before and after."""
    former, now = tmp_path / "former.yaml", tmp_path / "now.yaml"
    former.write_text(
        """
name: cart
law: guarded
compass: {noise_deg: 0.5}
hearing: ideal
ideal_hearing: {burst_gaps: false, bearing_noise_deg: 0.0}
repulsion: {velocity_term: closing, active: {reach_m: 0.7}}
guard: {margin_m: 0.006, place_error_m: 0.01}
free_space: {cell_m: 0.04, window_m: 12.8}
tdoa: {maximum_misfit: 0.05, low_hz: 400.0, band: set}
integrator: {step_s: 0.005, scheme: runge_kutta5}
microphones: {faults: [{microphone: 2, start_s: 1.5}]}
odometry: {lost_at_s: 3.0, rounding: false, pulses_per_revolution: 650}
""",
        "utf-8",
    )
    now.write_text(
        """
name: cart
law: guarded
hearing: ideal_always
collision_vector: {velocity_term: closing}
laws: {active: {reach_m: 0.7}}
guard: {place_error_m: 0.01, cell_m: 0.04}
integration_step_s: 0.005
plant: {pulses_per_revolution: null}
tdoa: {band_hz: [400, 15000]}
faults:
  - {sensor: microphones, number: 2, kind: dead, start_s: 1.5}
  - {sensor: odometry, kind: lost, start_s: 3.0}
""",
        "utf-8",
    )
    assert load_scenario(former) == load_scenario(now)


def test_the_impedance_is_that_of_the_robots_law(tmp_path):
    """The previous version had it for each law, with all values in a saved file."""
    file = tmp_path / "old.yaml"
    file.write_text(
        """
law: trajectory_filtered
route: {goal_m: [4, 0]}
laws:
  trajectory_conventional: {security_zone_m: 0.7, stiffness_n_m: 5}
  trajectory_filtered: {contact_stiffness_n_m: 9}
""",
        "utf-8",
    )
    own = load_scenario(file).router.gains
    assert own.stiffness_n_m == 3.0
    assert own.security_zone_m == 0.8
    assert own.contact_stiffness_n_m == 9.0


def test_a_map_without_a_guard_makes_no_guard(tmp_path):
    file = tmp_path / "old.yaml"
    file.write_text("free_space: {cell_m: 0.04}\n", "utf-8")
    robot = load_scenario(file).only
    assert isinstance(robot, Follower)
    assert robot.guard is None


@pytest.mark.parametrize("robot", ["", "robots.a."])
def test_another_value_than_the_constant_is_refused(robot):
    field = f"{robot}repulsion.dwa.period_s"
    with pytest.raises(InputError, match=r"^.*period_s: is 0.2.*_PERIOD_S = 0.25"):
        load_scenario("default", {field: 0.2})
    with pytest.raises(InputError, match=r"^tdoa.maximum_misfit: is 0.1"):
        load_scenario("default", {"tdoa.maximum_misfit": 0.1})


def test_shorthand_that_all_robots_override_is_refused():
    with pytest.raises(InputError, match=r"^start.position_m: has no effect"):
        load_scenario("convoy", {"start.position_m": [1.0, 1.0]})
    turned = load_scenario("convoy", {"start.heading_deg": 5.0})
    assert {each.start.heading_deg for each in turned.robots.values()} == {5.0}


FAR = """
law: guarded
hearing: ideal
ideal_hearing: {burst_gaps: false, maximum_range_m: 200.0}
following: {cruise_speed_m_s: 0.8}
free_space: {start_bubble_m: 0.7}
"""


def test_a_limit_without_effect_is_named_and_left_out(tmp_path, caplog):
    file = tmp_path / "old.yaml"
    file.write_text(FAR, "utf-8")
    robot = load_scenario(file).follower
    assert robot.guard is not None
    assert (robot.hearing, robot.guard.start_bubble_m) == ("ideal_always", 0.7)
    assert "maximum_range_m has no effect: ideal hearing has no" in caplog.text
    field = "ideal_hearing.maximum_range_m"
    assert load_scenario("default", {field: 50.0}) == load_scenario("default")


def test_the_map_of_a_law_that_is_replaced_makes_no_guard(tmp_path):
    file = tmp_path / "old.yaml"
    file.write_text(FAR, "utf-8")
    assert load_scenario(file, law="dwa").follower.guard is None
