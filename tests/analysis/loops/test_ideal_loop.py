"""The one-period map of the all-ideal build, and its derivatives."""

from __future__ import annotations

import math
import re
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.loops.contact_mode import motion_chain
from analysis.loops.diagram_linearization import linearize
from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.ideal_scenarios import (
    frozen_scenario,
    ideal_scenario,
    require_ideal,
)
from analysis.loops.linearization import check_gradient
from analysis.loops.radial_law import radial_law
from analysis.stability.linear_parts import (
    LINEAR_MODELS,
    OPERATING_POINTS,
    LinearModels,
)
from diagrams import build_sound_follower, make_simulator
from diagrams.scenario.scenario import Scenario
from docs.building.page_code import page_file
from systems.framework.signals import TICK_S as T

pytestmark = pytest.mark.drake


def rest(law="conventional", **data):
    return ideal_loop(ideal_scenario(Scenario.model_validate({"law": law} | data)))


def test_state_names_are_as_many_as_states_and_unique():
    loop = rest()
    names = loop.state_names
    assert len(names) == loop.follower.diagram.CreateDefaultContext().num_total_states()
    assert len(set(names)) == len(names)
    assert not any("state_" in name for name in names)


def test_period_map_is_what_the_simulator_does():
    """Two periods from a moving start, against a simulator of its own."""
    loop = rest("active", start={"position_m": [0.3, 0.2], "heading_deg": 30.0})
    simulator = make_simulator(loop.follower)
    simulator.Initialize()
    simulator.AdvanceTo(1.0)
    context = simulator.get_context()

    def state():
        groups = range(context.num_discrete_state_groups())
        return np.concatenate(
            [context.get_continuous_state_vector().CopyToVector()]
            + [context.get_discrete_state(k).CopyToVector() for k in groups]
        )

    before = state()
    simulator.AdvanceTo(1.0 + 2 * T)
    after = loop.period_map(before, 1.0, periods=2)
    np.testing.assert_allclose(after, state(), atol=1e-12)
    assert np.abs(after - before).max() > 1e-3


def test_settled_state_rests_where_no_force_acts():
    """1.2 m before the source, out of the conventional law's reach."""
    loop = rest()
    state, time_s = loop.settled_state((2.0 - 1.2 - 0.175, 0.0, 0.0))
    np.testing.assert_allclose(loop.period_map(state, time_s), state, atol=1e-14)


def test_derivatives_are_those_of_finite_differences():
    loop = rest("active", tracker={"hold": "world"})
    state, time_s = loop.settled_state((0.5, 0.1, 0.2))
    port = (("tracker", "p_PS_B"),)
    value = [1.3, -0.2]
    outputs = [("controller", "acceleration_W")]
    found = loop.period_derivatives(
        state, time_s, inputs={port: value}, outputs=outputs
    )
    step = 1e-7
    for name in ("plant.x", "plant.theta", "command.v_WP_y", "odometry.theta"):
        k = loop.state_names.index(name)
        moved = []
        for sign in (1.0, -1.0):
            shifted = state.copy()
            shifted[k] += sign * step
            fixed = {port[0]: value}
            moved.append(loop.period_map(shifted, time_s, fixed=fixed))
        column = (moved[0] - moved[1]) / (2 * step)
        np.testing.assert_allclose(found.A[:, k], column, atol=1e-6)
    assert found.B.shape == (len(state), 2)
    assert found.C.shape == (2, len(state))
    # A target that is 1 m farther away pulls K_r / M harder.
    direction = np.array([np.cos(0.2), np.sin(0.2)])
    assert direction @ found.D @ [1, 0] == pytest.approx(2.0 / 3.94, rel=0.03)


def test_a_loop_is_built_once_for_a_scenario():
    assert rest("none") is rest("none")


def test_frozen_scenario_holds_bodies_where_they_are():
    scenario = Scenario.model_validate(
        {
            "source": {"waypoints_m": [[2.0, 0.0], [5.0, 0.0]], "speed_m_s": 0.3},
            "obstacles": [{"waypoints_m": [[3.0, 2.0], [3.0, -2.0]], "speed_m_s": 0.5}],
        }
    )
    frozen = frozen_scenario(scenario, 2.0)
    for time in (0.0, 7.0):
        # Starting at 1 m/s^2 costs v^2 / 2a; the source's drive settles to 1 mm.
        pose = frozen.source.path().pose(time)
        np.testing.assert_allclose(pose, [2.6 - 0.045, 0.0, 0.0], atol=1e-3)
        pose = frozen.obstacles[0].path().pose(time)
        np.testing.assert_allclose(pose, [3.0, 1.0 + 0.125, -np.pi / 2])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hearing": "audio"}, "waveform"),
        ({"obstacle_sensing": "ultrasonic"}, "cones"),
        ({"plant": {"pulses_per_revolution": 2600}}, "rounded"),
    ],
)
def test_what_has_no_derivative_is_refused_with_a_remedy(change, message):
    data = ideal_scenario(Scenario()).model_dump() | change
    with pytest.raises(ValueError, match=rf"{message}.*ideal_scenario"):
        require_ideal(Scenario.model_validate(data))


def test_wheels_that_slip_are_refused_with_a_remedy():
    slippery = Scenario.model_validate({"plant": {"friction": 0.3}})
    for analysis in (ideal_scenario, require_ideal, motion_chain):
        with pytest.raises(ValueError, match=r"^plant.friction: is 0.3, .* to null"):
            analysis(slippery)


OWN_LAWS = '''
import math
from pydrake.math import exp
import numpy as np
from systems import Block, ImpedanceController, Port, Step
from systems.laws.catalog import CONVENTIONAL
from systems.laws.impedance_controller import impedance_step


def smooth(c, s, laws):
    return 3.0 * exp(-2.0 * c)


def rough(c, s, laws):
    push = 3.0 * math.exp(-2.0 * c) if c < 3.0 else 0.0
    return push + 0.5 * float(np.clip(s, 0.0, 0.3))


class Block3(Block):
    """The conventional law's block, in floats only."""

    part, stage = "controller", "control"
    inputs, outputs = ImpedanceController.inputs, ImpedanceController.outputs

    def __init__(self, robot, attraction, sensors, velocity_term, tick_s, laws):
        super().__init__()
        self.set_name("own_law")
        model = ImpedanceController(
            law=CONVENTIONAL, gains=laws.conventional, robot=robot, tick_s=tick_s,
            attraction=attraction, sensors=sensors, velocity_term=velocity_term,
        )
        self.states = model.states

        def step(tick, state, inputs, outputs, numbers):
            plain = [[float(x) for x in each] for each in inputs]
            impedance_step(tick, state, plain, outputs, numbers)

        self.declare(Step(step, *model.step[1:3]), tick_s=tick_s)


class Slow(Block):
    """Holds the speed of P over two control periods."""

    part = "slow"
    inputs, outputs = (Port("v_WP", 2, "m/s"),), (Port("v_slow", 2, "m/s"),)

    def __init__(self, tick_s):
        super().__init__()
        self.set_name("slow")

        def step(tick, state, inputs, outputs, numbers):
            state[:] = inputs[0]

        def publish(state, outputs, numbers):
            outputs[0][:] = state

        self.declare(Step(step, (), [0.0, 0.0], publish), tick_s=2.0 * tick_s)
'''


@pytest.fixture
def own_laws(tmp_path, monkeypatch):
    (tmp_path / "own_laws_for_loops.py").write_text(OWN_LAWS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.delitem(sys.modules, "own_laws_for_loops", raising=False)
    return "own_laws_for_loops"


def test_a_users_law_is_linearized_like_ours(own_laws):
    loop = rest(f"{own_laws}:smooth")
    state, time_s = loop.settled_state((0.6, 0.0, 0.0))
    found = loop.period_derivatives(
        state, time_s, outputs=[("controller", "acceleration_W")]
    )
    c = 2.0 - 0.163 - 0.775
    force = 2.0 * (1.225 - 1.2) - 3.0 * math.exp(-2.0 * c)
    assert found.y[0] == pytest.approx(force / 3.94, rel=1e-9)


def matrix(loop):
    state, time_s = loop.settled_state((0.6, 0.1, 0.2))
    return loop.period_derivatives(state, time_s).A


def test_a_law_that_refuses_autodiff_is_linearized_by_differences(own_laws):
    """Both laws of the file have the same force before a body at rest."""
    loop = rest(f"{own_laws}:rough")
    (said,) = loop.differences()
    assert "cannot differentiate the law" in said
    search = SimpleNamespace(scenario=loop.scenario, notes=("another",))
    found: Any = SimpleNamespace(search=search)
    notes = OPERATING_POINTS.notes(found)
    assert notes == (said, "another")
    assert rest(f"{own_laws}:smooth").differences() == ()
    law = radial_law(loop.scenario)
    for c, s in ((1.062, 0.0), (1.062, 0.2), (1e-7, 0.2)):
        slopes = -6.0 * math.exp(-2.0 * c), 0.5
        assert law.gradient(c, s) == pytest.approx(slopes, rel=1e-8)
    assert law.gradient(3.5, 0.5) == pytest.approx((0.0, 0.0), abs=1e-8)
    smooth = rest(f"{own_laws}:smooth")
    at = (0.6, 0.1, 0.2)
    matrices = [
        each.period_derivatives(*each.settled_state(at)).A[
            :, [each.state_names.index(f"plant.{k}") for k in ("x", "y", "theta")]
        ]
        for each in (loop, smooth)
    ]
    np.testing.assert_allclose(matrices[0], matrices[1], atol=1e-8)
    # The report states an estimate of this error.
    state, time_s = loop.settled_state(at)
    point: Any = SimpleNamespace(loop=loop, state=state, time_s=time_s)
    none: Any = None
    found = LinearModels(point, none, none, none, check_gradient(point))
    error = found.difference_error
    assert error is not None
    assert np.abs(matrices[0] - matrices[1]).max() <= error < 1e-5
    (said,) = LINEAR_MODELS.notes(found)
    assert f"is estimated as at most {error:.1e}" in said
    point.loop = smooth
    assert LINEAR_MODELS.notes(found) == []


def test_a_law_block_of_floats_is_linearized_by_differences(own_laws):
    """The same computation as the conventional law, whose block converts."""
    loop = rest(f"{own_laws}:Block3")
    (said,) = loop.differences()
    assert said.startswith("The block controller does not convert")
    ours = rest("conventional")
    A, expected = matrix(loop), matrix(ours)
    vary = [k for k, name in enumerate(ours.state_names) if "feature" not in name]
    assert np.abs(expected[:, vary]).max() > 1.0
    np.testing.assert_allclose(A[:, vary], expected[:, vary], atol=1e-7)


def test_a_block_with_its_own_state_is_linearized_by_differences(tmp_path, monkeypatch):
    """The page's command computes what ours does, in floats."""
    for name in ("rear_sonar.py", "careful_command.py"):
        (tmp_path / name).write_text(page_file("extending.md", name), "utf-8")
    monkeypatch.chdir(tmp_path)
    blocks = {
        "blocks": ["rear_sonar.py:RearSonar", "careful_command.py:CarefulCommand"]
    }
    loop = rest(**blocks)
    said = " ".join(loop.differences())
    assert "block rear_sonar" in said
    assert "block command" in said
    A, expected = matrix(loop), matrix(rest())
    sonar = loop.indices("rear_sonar")
    kept = [k for k in range(len(A)) if k not in sonar]
    assert len(kept) == len(expected)
    np.testing.assert_allclose(A[np.ix_(kept, kept)], expected, atol=1e-7)
    named = page_file("extending.md", "careful_command.py")
    unnamed = re.sub("    states = .*", "", named)
    (tmp_path / "careful_command.py").write_text(unnamed, "utf-8")
    with pytest.raises(ValueError, match="careful_command has no state v_WP_x"):
        rest(**blocks)


def test_a_block_with_another_period_is_refused_with_a_remedy(own_laws):
    blocks = {"blocks": [f"{own_laws}:Slow"]}
    with pytest.raises(ValueError, match=r"slow updates every 0\.05 s.*linearize"):
        rest(**blocks)
    scenario = ideal_scenario(Scenario.model_validate(blocks))
    found = linearize(build_sound_follower(scenario).diagram)
    assert found.model.period_s == pytest.approx(2.0 * T)
    assert ("robot/slow", "does not convert") in {
        (each.where, each.why[:16]) for each in found.undifferentiated
    }
