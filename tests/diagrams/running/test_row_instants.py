"""A row of a run's table is of one instant: all that is done at a tick is in its row.

The place of a robot is that at the tick, and a command acts from the tick on.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from diagrams import RunResult, build_sound_follower, load_scenario, simulate
from diagrams.building.robot import publishes_state
from diagrams.running.simulation import make_simulator
from diagrams.scenario.run_parameters import Engine
from diagrams.scenario.scenario import WORLD
from systems.laws.catalog import LAWS

EXACT = ("integration_step_s=0.002",)
HEARING = "hearing=ideal", "duration_s=3"
BOX = "obstacles=[{name: box, size_m: [0.2, 0.2], waypoints_m: [[1.4, 0.5]]}]"
#: By law a scenario in which it moves.
MOVING = {
    name: ("one_moving_obstacle", HEARING)
    for name, law in LAWS.items()
    if law.robot == "follower"
} | {
    name: ("unknown_block", ("duration_s=3",))
    for name, law in LAWS.items()
    if law.robot == "router"
}
MOVING |= {
    "plume_search": ("odor_search", ("search.wait_s=0.5", "duration_s=6")),
    "sound_search": ("sound_search", ("room=null", "duration_s=9")),
}
ENGINES: tuple[Engine, ...] = ("drake", "compiled")
GUARDED = [f"{law} guarded" for law in ("active", "dwa")]


def run(law: str, engine: Engine) -> RunResult:
    """Of a law's name, which may be followed by that of a guard."""
    law, _, guard = law.partition(" ")
    name, settings = MOVING[law]
    more = ["guard={}"] if guard else []
    scenario = load_scenario(name, [f"law={law}", *settings, *EXACT, *more])
    assert scenario.only.plant.slip == (0.0, 0.0)
    return simulate(scenario, engine=engine)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("law", [*MOVING, *GUARDED])
def test_a_rows_command_moves_the_wheels_to_the_next_row(law, engine):
    """A wheel lags exponentially behind a command that is held for a tick."""
    result = run(law, engine)
    robot, columns = result.scenario.only.robot, result.columns
    heading, turning = columns["theta_WB"], columns["omega_WB"]
    forward = columns["v_WB_x"] * np.cos(heading) + columns["v_WB_y"] * np.sin(heading)
    assert len(result.time) > 20
    for side, sign in (("left", -0.5), ("right", 0.5)):
        rim = forward + sign * robot.wheel_separation_m * turning
        wheel, command = rim / robot.wheel_radius_m, columns[f"wheel_speed_{side}"]
        left = math.exp(
            -result.scenario.tick_s / result.scenario.only.plant.motor_lag_s
        )
        after = command[:-1] + left * (wheel[:-1] - command[:-1])
        np.testing.assert_allclose(wheel[1:], after, rtol=0.0, atol=1e-8)
        # What the run shows: that of the next row would be off.
        wrong = command[1:] + left * (wheel[:-1] - command[1:])
        assert np.abs(wheel[1:] - wrong).max() > 1e-3
    if "plume" not in law and "sound" not in law:
        _check_chain(result, guarded="guarded" in law.partition(" ")[2])


def _check_chain(result: RunResult, *, guarded: bool) -> None:
    """From what the law puts out to the wheels, in one row."""
    columns, robot = result.columns, result.scenario.only.robot
    vx, vy = columns["v_WP_x"], columns["v_WP_y"]
    if result.scenario.only.kind != "router":
        theta = columns["theta_WB_estimated"]
        c, s = np.cos(theta), np.sin(theta)
        v, omega = c * vx + s * vy, (c * vy - s * vx) / robot.control_point_m
        half = 0.5 * robot.wheel_separation_m * omega
        rims = np.stack([v - half, v + half]) / robot.wheel_radius_m
        rims /= np.maximum(1.0, np.abs(rims).max(axis=0) / robot.top_wheel_speed)
        told = [columns[f"wheel_speed_{side}"] for side in ("left", "right")]
        if not guarded:
            np.testing.assert_allclose(told, rims, rtol=0.0, atol=1e-9)
    if "wanted_speed" in columns and not guarded:
        speed, turn = columns["wanted_speed"], columns["wanted_turn"]
        lengths = np.hypot(speed, robot.control_point_m * turn)
        free = lengths < robot.top_speed_m_s
        assert np.count_nonzero(free) > 0
        np.testing.assert_allclose(v[free], speed[free], rtol=0.0, atol=1e-9)
    if (
        "attraction_x" in columns
        and result.scenario.only.kind != "router"
        and not guarded
    ):
        tick_s, mass = result.scenario.tick_s, robot.mass_kg
        force = result.vector("attraction") + result.vector("repulsion")
        before = np.c_[np.zeros(2), result.vector("v_WP")[:, :-1]]
        after = before + tick_s * force / mass
        speed = np.hypot(*after)
        after *= np.minimum(1.0, robot.top_speed_m_s / np.maximum(speed, 1e-9))
        np.testing.assert_allclose(result.vector("v_WP"), after, rtol=0.0, atol=1e-9)


#: Blocks of all kinds, and for how long they run.
RUNS = {
    "by ear": ("default", ("duration_s=0.8",)),
    "guarded": ("default", ("hearing=ideal", "guard={}", "duration_s=1", BOX)),
    "planned": ("default", ("hearing=ideal", "law=guarded", "duration_s=1", BOX)),
    "slow frames": (
        "default",
        ("hearing=ideal", "microphones.frame_s=0.1", "duration_s=1", "law=orca"),
    ),
    "routed": ("robots_2", ("law=trajectory_filtered", "duration_s=1")),
    "adaptive": ("unknown_block", ("law=trajectory_adaptive", "duration_s=1")),
    "slipping": ("default", ("hearing=ideal", "plant.friction=0.1", "duration_s=1")),
    "searching": ("odor_then_sound", ("room=null", "duration_s=1.5")),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_every_column_is_of_what_is_done_at_its_row(name):
    """Evaluated tick by tick in Drake's diagram.

    What is made of present inputs before the updates of the tick, which would let it
    see the same inputs twice; what is state after them.
    """
    scenario = load_scenario(RUNS[name][0], list(RUNS[name][1]))
    follower = build_sound_follower(scenario, log=True)
    every = {**follower.robots}
    if follower.world is not None:
        every[WORLD] = follower.world
    simulator = make_simulator(follower)
    simulator.Initialize()
    root, rows, kinds = simulator.get_context(), [], Counter[bool]()
    ticks = round(scenario.duration_s / scenario.tick_s)
    for tick in range(ticks + 1):
        if tick > 0:  # to 0 s it would do the updates of that tick
            simulator.AdvanceTo(tick * scenario.tick_s)
        row: dict[tuple[str, str], float] = {}
        for after in (False, True):
            if after:
                simulator.AdvancePendingEvents()
            for robot, parts in every.items():
                for (part, port), columns in parts.logged.items():
                    block = parts.blocks[part]
                    if publishes_state(block, port) == after:
                        own = block.GetMyContextFromRoot(root)
                        values = block.GetOutputPort(port).Eval(own)
                        row |= {
                            (robot, column): value
                            for column, value in zip(columns, values, strict=True)
                        }
                        kinds[after] += 1
        rows.append(row)
    assert kinds[False] > ticks
    assert kinds[True] > ticks
    for engine in ENGINES:
        result = simulate(scenario, engine=engine)
        assert len(result.time) == ticks + 1
        compared = 0
        for robot, column in rows[0]:
            expected = [row[robot, column] for row in rows]
            where = result.world if robot == WORLD else result.robots[robot].columns
            np.testing.assert_allclose(
                where[column], expected, rtol=0.0, atol=1e-9, err_msg=column
            )
            compared += 1
        assert compared == len(rows[0]) > 20


#: Blocks that make their step when a run begins, and whether their outputs are state.
WITHOUT_STEP = {
    "diff_drive_plant": False,
    "source_tracker": False,
    "ideal_source_sensor": True,
    "tdoa_estimator": True,
    "cross_power_estimator": True,
}


@pytest.mark.parametrize("name", RUNS)
def test_both_engines_agree_on_what_is_state(name):
    scenario = load_scenario(RUNS[name][0], list(RUNS[name][1]))
    follower = build_sound_follower(scenario, log=True)
    checked = 0
    for parts in follower.robots.values():
        for part, port in parts.logged:
            block = parts.blocks[part]
            late = WITHOUT_STEP.get(block.get_name())
            if late is None:
                late = block.step.publish is not None
            assert publishes_state(block, port) == late, part
            checked += 1
    assert checked > 4


@pytest.mark.parametrize("engine", ENGINES)
def test_the_first_row_and_the_last_are_as_those_between(engine):
    """A longer run has the same row in its midst."""
    settings = ["hearing=ideal_always", "law=none", "obstacles=[]"]
    short, longer = (
        simulate(
            load_scenario("default", [*settings, f"duration_s={s}"]), engine=engine
        )
        for s in (1.0, 1.2)
    )
    assert len(short.time) == 41
    for column, values in short.columns.items():
        np.testing.assert_array_equal(values, longer.columns[column][:41], column)
    assert short.columns["detected"][0] == 1.0, "it hears at 0 s"
    assert short.columns["target_valid"][0] == 0.0, "and goes by it a tick later"
    command = short.columns["wheel_speed_left"]
    assert command[0] == 0.0
    assert command[1] > 0.0
    assert command[-1] != command[-2]
