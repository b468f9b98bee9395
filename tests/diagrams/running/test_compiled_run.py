"""The compiled loop is Drake's run: same cause, same tick, places within 1e-9 m."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from diagrams import load_scenario, simulate
from systems.framework.input_error import InputError

pytestmark = pytest.mark.drake

TOUCHING = ("robots.second.attraction={follow_distance_m: 0.1}",)
FINER = ("integration_step_s=0.01",)

OWN_LAW = """
from pydrake.math import exp


def gaussian(c, s, laws):
    return 6.0 * exp(-c * c / laws.active.alpha_m) + 0.5 * s


def wordy(c, s, laws):
    return 1.0 / float(str(c))
"""

OWN_BLOCKS = """
import math

from systems import Block, Port, Step


def speed_of(velocity):
    return math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)


def speed_step(tick, state, inputs, outputs, numbers):
    (velocity,), (mean,) = inputs, outputs
    state[0] += numbers[0] * (speed_of(velocity) - state[0])
    mean[0] = state[0]


class Speedometer(Block):
    part, stage = "speedometer", "robot"
    inputs = (Port("velocity_WB", 3, "m/s, m/s, rad/s"),)
    outputs = (Port("mean", 1, "m/s", ("mean_speed",)),)

    def __init__(self, tick_s):
        super().__init__()
        self.set_name("speedometer")
        self.declare(Step(speed_step, (tick_s / 0.5,), [0.0]), tick_s=tick_s)


class Stepless(Block):
    part, stage = "stepless", "robot"

    def __init__(self):
        super().__init__()
        self.set_name("stepless")
"""


@pytest.fixture(scope="module")
def own_law(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("laws") / "own_law.py"
    file.write_text(OWN_LAW, encoding="utf-8")
    return file


def both(name, *overrides):
    scenario = load_scenario(name, ["hearing=ideal", *overrides])
    return (simulate(scenario, engine=engine) for engine in ("drake", "compiled"))


def assert_same(name, *overrides):
    drake, compiled = both(name, *overrides)
    assert (drake.engine, compiled.engine) == ("drake", "compiled")
    assert compiled.cause == drake.cause
    assert compiled.collision == drake.collision
    assert compiled.columns.keys() == drake.columns.keys()
    np.testing.assert_array_equal(compiled.time, drake.time)
    for column, values in drake.columns.items():
        # Speeds are differences of places over a tick.
        atol = 1e-6 if "speed" in column else 1e-9
        np.testing.assert_allclose(
            compiled.columns[column], values, rtol=0.0, atol=atol, err_msg=column
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("default", ()),
        ("two_static_obstacles", ("seed=2",)),
        ("one_moving_obstacle", ("ultrasonic.dropout_probability=0.1",)),
        ("two_moving_obstacles", ("ultrasonic.firing=sequential",)),
        ("corridor", ("tick_s=0.0125", "microphones.frame_s=0.05")),
        ("obstacle_free", ("tracker.hold=robot",)),
        ("default", ("sound.start_s=30", "stop.lost_after_s=5")),
        ("default", ("start.heading_deg=180", "stop.diverged_range_m=2.5")),
        ("u_trap", ("ultrasonic.sensors=8", "collision_vector.aggregation=sum")),
        ("convoy", ("hearing=ideal_always", "law=none", *FINER)),
        ("convoy", (*TOUCHING, "law=none", *FINER)),
    ],
)
def test_runs_are_those_of_drake(name, overrides):
    """All share the blocks that they have in common, each compiled once."""
    assert_same(name, *overrides)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["wall", "one_moving_obstacle"])
def test_a_users_law_on_wheels_that_slip(own_law, name):
    law = f"law={own_law}:gaussian"
    slip = "plant.friction=0.05", "obstacle_sensing=ideal"
    assert_same(name, law, *slip)


@pytest.fixture
def own_blocks(tmp_path: Path) -> Path:
    file = tmp_path / "own_blocks.py"
    file.write_text(OWN_BLOCKS, encoding="utf-8")
    return file


@pytest.mark.slow
def test_a_users_block_joins_by_its_step(own_blocks):
    block = f"blocks=[{own_blocks}:Speedometer]"
    drake, compiled = both("default", block, "duration_s=5")
    mean = drake.columns["mean_speed"]
    assert mean.max() > 0.3
    np.testing.assert_allclose(compiled.columns["mean_speed"], mean, atol=1e-9)


def test_a_users_block_without_a_step_is_named(own_blocks):
    block = f"blocks=[{own_blocks}:Stepless]"
    with pytest.raises(InputError, match=r"engine: stepless has no step"):
        list(both("default", block, "duration_s=0.1"))


@pytest.mark.slow
def test_a_law_that_numba_cannot_compile_is_named(own_law):
    law = f"law={own_law}:wordy"
    with pytest.raises(
        InputError, match=r"engine: numba cannot compile '.*own_law.*drake"
    ):
        list(both("default", law, "duration_s=0.1"))
