"""The guard in the loop: what it passes and refuses, the same with both engines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagrams import Scenario, load_scenario, simulate
from phonotaxis.testing import Bench
from systems import FreeSpaceMap, MotionGuard, WheelCommand
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters, body_radius
from systems.framework.block import RunFacts
from systems.framework.input_error import InputError
from systems.safety.braking import HALTED
from systems.safety.free_space import cell_is_free, clear_disc, make_free_space
from systems.safety.free_space_map import map_step
from systems.safety.parameters import GuardParameters
from systems.safety.views import PlaceError, lasting

pytestmark = pytest.mark.drake

OWN_LAWS = """
import math

from systems import Block, Port, Step


def pushing(tick, state, inputs, outputs, numbers):
    outputs[0][0] = numbers[0] * math.cos(numbers[2] * tick)
    outputs[0][1] = numbers[1] + numbers[3] * math.sin(numbers[2] * tick)


class Pushing(Block):
    part = "controller"
    inputs = (Port("pose_WB_estimated", 3, "m, m, rad"),)
    outputs = (Port("twist_B", 2, "m/s, rad/s"),)
    NUMBERS = (0.5, 0.3, 0.0, 0.0)

    def __init__(self, tick_s):
        super().__init__()
        self.set_name("pushing")
        self.declare(Step(pushing, self.NUMBERS), tick_s=tick_s)


class Backing(Pushing):
    NUMBERS = (-0.7, 0.2, 0.0, 0.0)


class Swinging(Pushing):
    NUMBERS = (0.7, 0.0, 0.03, 2.0)
"""


@pytest.fixture(scope="module")
def own_laws(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("laws") / "own_laws.py"
    file.write_text(OWN_LAWS, encoding="utf-8")
    return file


def known_space(radius: float = 3.0) -> Any:
    space = make_free_space(200, 0.05, 3, 17)
    clear_disc(space, 0.0, 0.0, radius, math.inf)
    return space


def guarded(space: Any, acceleration: Any, fault: float = 0.0, **fields: Any) -> Any:
    """The guard's state after a tick: v_P, wheels, report, modeled wheels."""
    guard = MotionGuard(parameters=GuardParameters(**fields))
    made = Bench(
        guard,
        acceleration_W=acceleration,
        pose_WB_estimated=[0, 0, 0.3],
        sensing_fault=[fault, 0.0],
        free_space=space,
    )
    return made.next_state()


@pytest.mark.parametrize("acceleration", [(4.0, 1.0), (-3.0, 9.0), (80.0, -60.0)])
def test_in_known_space_it_is_the_block_in_whose_place_it_stands(acceleration):
    plain = Bench(
        WheelCommand(), acceleration_W=acceleration, pose_WB_estimated=[0, 0, 0.3]
    ).next_state()
    state = guarded(known_space(), acceleration)
    np.testing.assert_array_equal(state[:4], plain)
    assert state[4] == 0.0
    # The wheels follow with the lag: 1 - 1/sqrt(e) after half of it.
    np.testing.assert_allclose(state[8:], plain[2:] * (1.0 - math.exp(-0.5)))


def test_what_it_reports():
    """Rest at an edge that is 0.8 m away: 8 mm of cells that are only partly free."""
    state = guarded(known_space(0.8), (0.0, 0.0))
    assert state[4] == 0.0
    needed = body_radius(Scenario().only.robot) + 0.012
    # The lane ends where the disc does, and nothing is nearer beside it.
    assert 0.8 - 0.05 * math.sqrt(2.0) <= state[5] + needed <= 0.8
    assert state[6] == 0.0
    # At 0.4 m/s of the faster wheel it stops within v^2/2a + v (lag + tick).
    state = guarded(known_space(), (16.0 * math.cos(0.3), 16.0 * math.sin(0.3)))
    assert state[6] == pytest.approx(0.4**2 / 3.0 + 0.4 * 0.075)


def test_what_is_wrong_with_the_sensing_halts_it():
    state = guarded(known_space(), (4.0, 1.0), fault=2.0)
    np.testing.assert_array_equal(state[:5], [0.0, 0.0, 0.0, 0.0, HALTED])


def test_what_it_changes_the_virtual_mass_moves_by():
    """v_P is that of the wheels: else it would wind up against the guard."""
    state = guarded(known_space(0.55), (20.0, 0.0))
    assert state[4] > 0.0
    v = 0.06 * (state[2] + state[3]) / 2.0
    omega = 0.06 * (state[3] - state[2]) / 0.41
    c, s = math.cos(0.3), math.sin(0.3)
    expected = c * v - s * 0.175 * omega, s * v + c * 0.175 * omega
    np.testing.assert_allclose(state[:2], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("overrides", "field"),
    [
        (["obstacle_sensing=ideal"], "obstacle_sensing"),
        (
            ["ultrasonic.sensors=[{axis_deg: 60}, {axis_deg: -60}]"],
            "ultrasonic.sensors",
        ),
        (["obstacles=[{name: box, waypoints_m: [[0.9, 0]]}]"], "start.position_m"),
        (
            [
                "guard.start_bubble_m=0.5",
                "obstacles=[{name: box, size_m: [0.1, 0.1], waypoints_m: [[0.54, 0]]}]",
            ],
            "start.position_m",
        ),
        (["source.waypoints_m=[[1.1, 0]]"], "start.position_m"),
        (
            ["guard.wheel_error=0.02", "guard.place_error_m=0.02"],
            "guard.place_error_m",
        ),
        (["guard.place_error_m=0"], "guard.place_error_m"),
        (["plant.pulses_per_revolution=30"], "guard.place_error_m"),
    ],
)
def test_a_guard_that_could_not_serve_is_refused(overrides, field):
    with pytest.raises(InputError) as error:
        load_scenario("default", ["guard={}", *overrides])
    assert error.value.field == field


EXACT = PlantParameters(pulses_per_revolution=None)
BLIND = [0.03] * 3, [1.0] * 3, [0.0] * 3
STILL = (0.0, 0.0)


def space_map(**given: Any) -> Any:
    """The numbers of a map whose steps are called by hand."""
    run = RunFacts(0, 0.025, (0, 0, 0), 0.0125, len, {})
    step = FreeSpaceMap(**given).step_for(run)
    return step.state, step.numbers


def test_a_cell_is_known_for_the_way_that_wheel_errors_allow():
    """Of the bubble, 1 m: 0.02 s + 0.04 s (1 + s)/0.41 = 0.03, solved by hand."""
    known = GuardParameters(wheel_error=0.02, place_error_m=0.03)
    state, numbers = space_map(parameters=known, plant=EXACT)
    b = 0.02 + 0.04 / 0.41
    lasts = (math.sqrt(b * b + 4.0 * 0.03 * 0.04 / 0.41) - b) / (2.0 * 0.04 / 0.41)
    for tick in range(100):
        way = 0.004 * tick
        map_step(tick, state, (*BLIND, (way, 0.0, 0.0), STILL), (), numbers)
        assert state.free_space.rolled_m[0] == pytest.approx(way)
        behind = cell_is_free(state.free_space, -14, 0, way)
        assert behind == (way <= lasts)
        # Under the body, 0.35 x 0.82 m, space stays known: the body is there.
        for x, y in ((way - 0.1, 0.0), (way, -0.3), (way, 0.3), (way + 0.1, 0.0)):
            cell = math.floor(x / 0.05), math.floor(y / 0.05)
            assert cell_is_free(state.free_space, *cell, way)
    assert 0.15 < lasts < 0.35


@pytest.mark.parametrize(
    ("motion", "rolled"),
    [((0.1, 0.0, 0.0), 0.1), ((0.0, 0.0, -0.4), 0.4 * 0.205), ((0.1, 0, 0.4), 0.1)],
)
def test_the_rolled_way_is_the_mean_of_both_rims(motion, rolled):
    """(|v + w| + |v - w|)/2 = max(|v|, |w|), with w of half the turn's rim.

    A way is counted as an arc's whose chord is given, and 5 % more at most.
    """
    state, numbers = space_map(plant=EXACT)
    arc = 1.0 if motion[2] == 0.0 else 0.2 / math.sin(0.2)
    longer = arc if rolled == 0.1 else 1.0
    for tick in range(4):
        pose = tuple(tick * each for each in motion)
        map_step(tick, state, (*BLIND, pose, STILL), (), numbers)
    found = state.free_space.rolled_m[0]
    assert 3.0 * rolled * longer - 1e-12 <= found <= 3.0 * rolled * longer * 1.05


def test_pulses_make_a_tick_count_half_a_pulse_more_and_a_reversal_its_command():
    """q = 0.145 mm; at least 0.083 of 25 ms at the faster wheel's command."""
    (state, numbers), pulse = space_map(), 0.06 * math.tau / 2600
    least = (2.0 / (1.0 - math.exp(-0.5)) - 4.0 - 1.0) * 0.06 * 0.025
    ways = [(0.01, 0.01, 5.0), (0.01, 0.01, -12.0), (0.0, 0.0, 0.0)]
    ways += [(0.0, 12.0 * least, 12.0), (0.0, 6.0 * least, -6.0)]
    x, tick = 0.0, 0
    map_step(tick, state, (*BLIND, (x, 0.0, 0.0), STILL), (), numbers)
    for moved, counted, command in ways:
        before, x, tick = state.free_space.rolled_m[0], x + moved, tick + 1
        commanded = (command, -0.5 * command)
        map_step(tick, state, (*BLIND, (x, 0.0, 0.0), commanded), (), numbers)
        found = state.free_space.rolled_m[0] - before
        assert found == pytest.approx(counted + 0.5 * pulse, abs=1e-12)


def test_by_the_encoders_of_the_papers_robot_a_cell_is_known_for_14_m():
    """(q/L) (s + d) + q = 6 mm at d = 2 m, with pulses of q = 0.145 mm at the rim."""
    pulse = 0.06 * math.tau / 2600
    error = PlaceError.of(GuardParameters(), RobotParameters(), PlantParameters())
    expected = (0.006 - pulse) * 0.41 / pulse - 2.0
    assert lasting(2.0, error) == pytest.approx(expected)
    assert 14.0 < expected < 15.0


GUARD = "guard={}"
ERRORS = "guard.wheel_error=0.005", "guard.place_error_m=0.03"
MOVING = "guard.obstacle_speed_m_s=0.3"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("two_static_obstacles", (GUARD, "seed=3")),
        ("one_moving_obstacle", (MOVING,)),
        ("corridor", (GUARD, "law=conventional", "ultrasonic.noise_m=0.01")),
        ("u_trap", (GUARD, "ultrasonic.sensors=12")),
        ("two_static_obstacles", (MOVING, "ultrasonic.firing=sequential")),
        ("default", (GUARD, "ultrasonic.period_s=0.05")),
        ("corridor", (GUARD, "tick_s=0.0125")),
        ("corridor", (*ERRORS, "plant.slip=[0.005, -0.005]")),
        ("convoy", (GUARD, "law=conventional")),
    ],
)
def test_guarded_runs_are_those_of_drake(name, overrides):
    scenario = load_scenario(name, ["hearing=ideal", "duration_s=12", *overrides])
    drake, compiled = (simulate(scenario, engine=e) for e in ("drake", "compiled"))
    assert_same(drake, compiled)
    for each in drake.robots.values():
        assert np.ptp(each.columns["p_WB_x"]) > 0.02


@pytest.mark.slow
@pytest.mark.parametrize("law", ["Pushing", "Backing", "Swinging"])
def test_a_pressing_law_is_held_at_the_edge_with_both_engines(own_laws, law):
    """12 s against unseen space: as near as the margin, and never much nearer."""
    scenario = load_scenario(
        "default",
        [
            "hearing=ideal",
            "duration_s=12",
            f"law={own_laws}:{law}",
            GUARD,
            "stop.stuck_after_s=100",
            "stop.lost_after_s=100",
            "source.waypoints_m=[[3, 3]]",
        ],
    )
    drake, compiled = (simulate(scenario, engine=e) for e in ("drake", "compiled"))
    assert_same(drake, compiled)
    assert len(drake.time) == 481
    # Of the distance beyond the margin of 12 mm; the least one is 3 mm nearer.
    assert -0.0033 <= drake.columns["guard_distance"].min() < 0.02
    assert drake.columns["guard_action"].max() > 0.0


def assert_same(drake: Any, compiled: Any) -> None:
    assert compiled.cause == drake.cause
    assert compiled.columns.keys() == drake.columns.keys()
    np.testing.assert_array_equal(compiled.time, drake.time)
    for column, values in drake.columns.items():
        atol = 1e-6 if "speed" in column else 1e-9
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=atol, err_msg=column
        )
