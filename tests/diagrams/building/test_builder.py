"""The built diagram: its blocks, wires, seeds, latencies and Jacobian."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator_,
    SimulatorConfig,
)
from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams import build_sound_follower, make_simulator, simulate
from diagrams.building.builder import SoundFollower
from diagrams.building.robot import block_seed, connect_by_name
from diagrams.scenario.scenario import Scenario
from systems import DiffDrivePlant, WheelCommand, WheelOdometry
from systems.laws.catalog import FORCE_LAWS

pytestmark = pytest.mark.drake

T = 0.025
IDEAL: dict[str, Any] = {
    "hearing": "ideal_always",
    "obstacle_sensing": "ideal",
    "plant": {"pulses_per_revolution": None},
    "ultrasonic": {"noise_m": 0.0},
}
COMMON_BLOCKS = {
    "active_impedance_controller",
    "collision_vector",
    "diff_drive_plant",
    "source_tracker",
    "wheel_odometry",
    "wheel_command",
}


def build(**data: Any) -> SoundFollower:
    return build_sound_follower(Scenario.model_validate(IDEAL | data))


def block_names(diagram: Diagram) -> set[str]:
    return {system.get_name() for system in diagram.GetSystems()}


def wires(diagram: Diagram) -> dict[tuple[str, str], tuple[str, str]]:
    """(block, input) to the (block, output) that it reads."""
    return {
        (to.get_name(), to.get_input_port(i).get_name()): (
            origin.get_name(),
            origin.get_output_port(j).get_name(),
        )
        for (to, i), (origin, j) in diagram.connection_map().items()
    }


def test_blocks_of_the_full_build():
    follower = build_sound_follower(Scenario())
    assert block_names(follower.diagram) == {"source", "obstacles", "robot"}
    audio = {"mic_array", "tdoa_estimator", "ultrasonic_array"}
    assert block_names(follower.robots["robot"].diagram) == COMMON_BLOCKS | audio
    source = follower.sources["source"].diagram
    assert block_names(source) == {"source_robot", "sound_emitter"}


def test_other_sources_are_wired_to_the_microphones():
    scenario = Scenario.model_validate(
        {
            "sources": {
                "source": {},
                "fan": {"waypoints_m": [[0.0, 3.0]]},
                "drill": {"waypoints_m": [[0.0, -3.0]], "body": False},
            }
        }
    )
    follower = build_sound_follower(scenario)
    found = wires(follower.diagram)
    assert found["robot", "emission"] == ("source", "emission")
    assert found["robot", "pose_WS"] == ("source", "pose_WS")
    for name in ("fan", "drill"):
        assert found["robot", f"emission_{name}"] == (name, "emission")
    assert found["robot", "poses_WO"] == ("fan", "pose_WS"), "the drill has no body"
    assert follower.robots["robot"].diagram.GetInputPort("poses_WO").size() == 3


def test_bad_files_are_named_by_their_whole_field(tmp_path):
    missing = str(tmp_path / "missing.wav")
    sound = {"kind": "wav", "file": missing}
    fan = {"waypoints_m": [[0.0, 3.0]], "sound": sound}
    for data, field in (
        ({"sound": sound}, r"sound\.file"),
        ({"sources": {"source": {}, "fan": fan}}, r"sources\.fan\.sound\.file"),
        ({"robots": {"a": {"loudspeaker": sound}}}, r"robots\.a\.loudspeaker\.file"),
        ({"microphones": {"ego_noise_file": missing}}, r"microphones\.ego_noise_file"),
    ):
        with pytest.raises(ValueError, match=rf"^{field}: .*missing\.wav"):
            build_sound_follower(Scenario.model_validate(data))


def test_emitters_reach_back_as_far_as_the_room_answers():
    """By 0.4 s: 136 m, where 30 m are enough without a room."""
    fan = {"waypoints_m": [[0.0, 3.0]]}
    scenario = Scenario.model_validate(
        {"room": {"reverberation_time_s": 0.4}, "sources": {"source": {}, "fan": fan}}
    )
    follower = build_sound_follower(scenario)
    context = follower.diagram.CreateDefaultContext()
    for parts in follower.sources.values():
        block = parts.blocks["emitter"]
        emission = block.get_output_port(0).Eval(block.GetMyContextFromRoot(context))
        assert emission.start_time <= -0.4 - 0.025


def test_blocks_of_the_ideal_build():
    ideal = {"ideal_source_sensor", "ideal_obstacle_sensor"}
    follower = build()
    names = block_names(follower.robots["robot"].diagram)
    assert names == COMMON_BLOCKS - {"collision_vector"} | ideal
    assert block_names(follower.sources["source"].diagram) == {"source_robot"}


@pytest.mark.parametrize("hearing", ["audio", "ideal"])
@pytest.mark.parametrize("obstacle_sensing", ["ultrasonic", "ideal"])
@pytest.mark.parametrize("law", FORCE_LAWS)
def test_every_input_is_connected_to_the_output_of_its_name(
    hearing, obstacle_sensing, law
):
    follower = build(hearing=hearing, obstacle_sensing=obstacle_sensing, law=law)
    robot = follower.robots["robot"].diagram
    found = wires(robot)
    outside = {
        robot.get_input_port(k).get_name() for k in range(robot.num_input_ports())
    }
    for block in follower.robots["robot"].blocks.values():
        for index in range(block.num_input_ports()):
            name = block.get_input_port(index).get_name()
            wire = found.get((block.get_name(), name))
            assert wire[1] == name if wire else name in outside
    around = wires(follower.diagram)
    assert {name for block, name in around if block == "robot"} == outside
    assert all(entry == output for (_, entry), (_, output) in around.items())
    assert follower.diagram.num_input_ports() == 0


def test_log_records_what_the_blocks_name_columns_for():
    scenario = Scenario.model_validate(IDEAL)
    follower = build_sound_follower(scenario, log=True)
    assert set(follower.logged) == {
        (part, name)
        for part, block in follower.robots["robot"].blocks.items()
        for name in getattr(block, "columns", ())
    }
    assert ("ultrasonic", "ranges") not in follower.logged
    assert build().log is None


def test_log_records_slip_where_there_is_friction():
    slipping = {"plant": {"friction": 0.3}, "duration_s": 0.1}
    scenario = Scenario.model_validate(IDEAL | slipping)
    follower = build_sound_follower(scenario, log=True)
    assert ("plant", "slip_velocities") in follower.logged
    assert "slip_left" in simulate(scenario).columns


def test_log_holds_the_ports_values_at_every_tick():
    follower = build_sound_follower(Scenario.model_validate(IDEAL), log=True)
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(12 * T)
    context = simulator.get_context()
    expected = [
        follower.port(role, name).Eval(
            follower.blocks[role].GetMyContextFromRoot(context)
        )
        for role, name in follower.logged
    ]
    assert follower.log is not None
    log = follower.log.FindLog(context)
    np.testing.assert_allclose(log.sample_times(), T * np.arange(13))
    np.testing.assert_array_equal(log.data()[:, -1], np.concatenate(expected))
    assert expected[0][0] > 0.001, "the robot must have moved"


@given(st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_seeds_differ_by_block_and_by_scenario(seed, other):
    names = ("sound_emitter", "mic_array", "ultrasonic_array", "ideal_source_sensor")
    seeds = {block_seed(s, name) for s in (seed, other) for name in names}
    assert len(seeds) == len(names) * len({seed, other})
    assert all(0 <= s < 2**64 for s in seeds)


def connect(*blocks: Any) -> None:
    builder = DiagramBuilder()
    for index, block in enumerate(blocks):
        builder.AddNamedSystem(f"block {index}", block)
    connect_by_name(builder, blocks)


def test_a_quantity_nobody_publishes_is_an_error():
    with pytest.raises(ValueError, match="0 blocks publish 'acceleration_W'"):
        connect(WheelCommand())


def test_two_publishers_of_a_quantity_are_an_error():
    plants = DiffDrivePlant(), DiffDrivePlant()
    with pytest.raises(ValueError, match="2 blocks publish 'wheel_angles'"):
        connect(WheelOdometry(), *plants)


def record(scenario: dict[str, Any], ticks: int, *ports: tuple[str, str]) -> list[Any]:
    """For each tick what the blocks read there, and the wheels' new command."""
    follower = build(**scenario)
    simulator = make_simulator(follower)
    simulator.Initialize()
    context = simulator.get_context()

    def read(role: str, name: str) -> Any:
        block = follower.blocks[role].GetMyContextFromRoot(context)
        value = follower.port(role, name).Eval(block)
        return np.array(getattr(value, "counts", value))

    rows = []
    for tick in range(ticks):
        simulator.AdvanceTo(tick * T)  # stops short of the updates at this tick
        seen = [read(*port) for port in ports]
        simulator.AdvanceTo((tick + 1) * T)
        rows.append([*seen, read("command", "wheel_speeds")])
    return rows


def first_difference(a: list[Any], b: list[Any], column: int) -> int:
    """First tick at which two runs differ."""
    for tick, (row_a, row_b) in enumerate(zip(a, b, strict=True)):
        if not np.array_equal(row_a[column], row_b[column]):
            return tick
    raise AssertionError("the runs do not differ")


def source_that_leaves_at(start_time: float) -> dict[str, Any]:
    path = {"waypoints_m": [[2.0, 0.5], [2.0, 3.0]], "start_time_s": start_time}
    return {"source": path, "law": "none"}


def test_from_the_source_to_the_wheels_is_one_tick():
    """Heard at the first tick at which it is elsewhere, acted on at the next."""
    ports = [("source", "pose_WS")]
    leaves, stays = (
        record(source_that_leaves_at(start), 24, *ports) for start in (10 * T, 99.0)
    )
    assert first_difference(leaves, stays, 0) == 11
    assert first_difference(leaves, stays, -1) == 12


def test_from_the_end_of_an_audio_frame_to_the_wheels_is_one_tick():
    """With full audio: from the first frame that differs to the first command."""
    ports = [("microphones", "audio")]
    leaves, stays = (
        record(source_that_leaves_at(start) | {"hearing": "audio"}, 16, *ports)
        for start in (10 * T, 99.0)
    )
    heard = first_difference(leaves, stays, 0)
    assert 10 <= heard <= 11
    assert first_difference(leaves, stays, -1) == heard + 1


@pytest.mark.parametrize("obstacle_sensing", ["ultrasonic", "ideal"])
def test_from_an_echo_to_the_wheels_is_no_tick(obstacle_sensing):
    def scenario(start_time: float) -> dict[str, Any]:
        box = {
            "waypoints_m": [[1.2, 0.0], [0.6, 0.0]],
            "size_m": [0.2, 0.4],
            "start_time_s": start_time,
        }
        source = {"waypoints_m": [[4.0, 0.0]]}
        return {
            "obstacles": [box],
            "source": source,
            "obstacle_sensing": obstacle_sensing,
        }

    ports = [("obstacles", "poses_WO")]
    moves, rests = (record(scenario(start), 16, *ports) for start in (10 * T, 99.0))
    assert first_difference(moves, rests, 0) == 11
    assert first_difference(moves, rests, -1) == 11


def test_an_ideal_estimate_is_placed_by_the_pose_of_its_moment():
    """A resting source stays put while the robot turns toward it."""
    source = {"waypoints_m": [[0.6, 2.5]]}
    follower = build(source=source, law="none")
    simulator = make_simulator(follower)
    simulator.Initialize()
    context = simulator.get_context()
    estimates, headings = [], []
    for tick in range(2, 80):
        simulator.AdvanceTo(tick * T)
        tracker = follower.blocks["tracker"].GetMyContextFromRoot(context)
        estimates.append(follower.port("tracker", "p_WS_estimated").Eval(tracker))
        plant = follower.blocks["plant"].GetMyContextFromRoot(context)
        headings.append(follower.port("plant", "pose_WB").Eval(plant)[2])
    np.testing.assert_allclose(estimates, [[0.6, 2.5]] * 78, atol=1e-3)
    assert max(np.diff(headings)) > 0.01, "a tick's turn moves 2.3 m by 2 cm"


class Step:
    """One 25 ms step of the diagram as a function of its stacked state."""

    def __init__(self, scenario: dict[str, Any], ticks: int) -> None:
        self.follower = build(**scenario)
        simulator = make_simulator(self.follower)
        simulator.Initialize()
        simulator.AdvanceTo(ticks * T)
        self.context = simulator.get_context().Clone()
        self.state = self._stacked(self.context)

    @staticmethod
    def _stacked(context: Any) -> Any:
        groups = [
            context.get_discrete_state(k).CopyToVector()
            for k in range(context.num_discrete_state_groups())
        ]
        continuous = context.get_continuous_state_vector().CopyToVector()
        return np.concatenate([continuous, *groups])

    def __call__(self, scalar: Any, state: Any) -> Any:
        diagram: Any = self.follower.diagram
        if scalar is AutoDiffXd:
            diagram = diagram.ToAutoDiffXd()
        simulator = Simulator_[scalar](diagram)
        config = SimulatorConfig()
        config.integration_scheme = "runge_kutta3"
        config.max_step_size = T
        config.use_error_control = False
        ApplySimulatorConfig(config, simulator)
        context = simulator.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self.context)
        at = context.num_continuous_states()
        context.SetContinuousState(state[:at])
        for k in range(context.num_discrete_state_groups()):
            size = context.get_discrete_state(k).size()
            context.SetDiscreteState(k, state[at : at + size])
            at += size
        simulator.Initialize()
        simulator.AdvanceTo(self.context.get_time() + T)
        return self._stacked(context)


@pytest.mark.parametrize("law", FORCE_LAWS)
def test_jacobian_of_a_step_agrees_with_finite_differences(law):
    scenario = {
        "law": law,
        "source": {"waypoints_m": [[2.5, 0.6]]},
        "obstacles": [{"waypoints_m": [[0.9, 0.5]], "size_m": [0.1, 0.2]}],
    }
    step = Step(scenario, ticks=30)
    dual = step(AutoDiffXd, InitializeAutoDiff(step.state).ravel())
    nothing = AutoDiffXd(0.0, np.zeros(step.state.size))
    jacobian = ExtractGradient(np.array([[x + nothing] for x in dual]))
    values = np.array([x.value() for x in dual])
    np.testing.assert_allclose(values, step(float, step.state), rtol=1e-12, atol=1e-12)

    differences = np.empty_like(jacobian)
    for k in range(step.state.size):
        shift = np.zeros(step.state.size)
        shift[k] = 1e-6
        high, low = (step(float, step.state + sign * shift) for sign in (1, -1))
        differences[:, k] = (high - low) / 2e-6
    assert np.all(np.isfinite(jacobian))
    assert np.linalg.matrix_rank(jacobian) > 7, "a step that depends on its state"
    # An exact sensor leaves a covariance of 1e-22 m^2, and differences would make it
    # negative: of the track's covariances, only those of the velocity are compared.
    tracker = step.follower.blocks["tracker"].states
    first = step.state.size - sum(
        len(block.states)
        for part, block in step.follower.blocks.items()
        if part in ("tracker", "controller", "command")
    )
    smooth = np.ones(step.state.size, dtype=bool)
    for k, name in enumerate(tracker):
        smooth[first + k] = not re.match(r"track_0_[AC]", name)
    assert np.sum(~smooth) == 7
    np.testing.assert_allclose(
        jacobian[:, smooth], differences[:, smooth], rtol=1e-5, atol=1e-5
    )


def test_rounding_bars_the_way_to_autodiff():
    follower = build(plant={"pulses_per_revolution": 2600})
    with pytest.raises(ValueError, match="pulses_per_revolution is 2600"):
        follower.diagram.ToAutoDiffXd()
