"""Tests of functions that test blocks: exact systems, and blocks that are wrong."""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import control
import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import Adder, Gain, Integrator, LinearSystem

import phonotaxis
from phonotaxis import InputError
from phonotaxis.testing import Bench, assert_linearization, drive, evaluate, run
from systems import CollisionVector, DiffDrivePlant, WheelCommand
from systems.framework.block import Block, Block_, Port, Step
from systems.framework.scalar_types import define_for_scalars

A: Any = np.array([[0.0, 1.0], [-4.0, -0.4]])
B: Any = np.array([[0.0], [1.0]])
C: Any = np.array([[1.0, 0.0], [0.3, 0.2]])
D: Any = np.array([[0.0], [0.5]])


class Counts(NamedTuple):
    """State of ``Counter``."""

    seen: NDArray[np.float64]


def count(tick, state, inputs, outputs, numbers):
    state.seen[0] += inputs[0][0]


def publish(state, outputs, numbers):
    outputs[0][0] = state.seen[0]


class Counter(Block):
    """Counts up; its state is a named tuple."""

    inputs = (Port("step", 1, "m"),)
    outputs = (Port("sum", 1, "m"),)

    def __init__(self):
        super().__init__()
        self.declare(Step(count, (), Counts(np.zeros(1)), publish), tick_s=0.1)


class Plain(LeafSystem):
    """A user's Drake system, which reads its inputs only for its second output."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("u", 2)
        self.DeclareAbstractInputPort("word", Value(object()))
        self.DeclareVectorOutputPort("time", 1, self._time, {self.time_ticket()})
        self.DeclareVectorOutputPort("length", BasicVector(1), self._length)

    def _time(self, context, output):
        output.SetAtIndex(0, context.get_time())

    def _length(self, context, output):
        word: Any = self.GetInputPort("word").Eval(context)
        u: Any = self.GetInputPort("u").Eval(context)
        output.SetAtIndex(0, len(word) * float(np.hypot(*u)))


def slip(tick, state, inputs, outputs, numbers):
    """The square; if ``numbers`` is not 1, with a wrong derivative."""
    x = inputs[0][0]
    outputs[0][0] = (
        x * x
        if isinstance(x, float)
        else x * x * numbers - (numbers - 1) * (x.value() ** 2)
    )
    outputs[1][0] = abs(inputs[0][1])


@define_for_scalars("Square_", __name__)
def Square_(T):
    class Impl(Block_[T]):  # type: ignore[valid-type,misc]
        """The square of a number, and the magnitude of another number."""

        inputs = (Port("x", 2, "m"),)
        outputs = (Port("square", 1, "m^2"), Port("magnitude", 1, "m"))

        def _construct(self, *, wrong=1.0, converter=None):
            super().__init__(converter=converter)
            self.declare(Step(slip, wrong), tick_s=0.1)

    return Impl


Square = Square_[None]


def test_a_block_of_drake_and_of_a_user_is_evaluated():
    found = evaluate(Adder(2, 3), u0=[1, 2, 3], u1=[10, 20, 30])
    np.testing.assert_array_equal(found["sum"], [11.0, 22.0, 33.0])
    block = Plain()
    found = evaluate(block, u=[3.0, 4.0], word="abc", time_s=7.0)
    assert (found["time"], found["length"]) == (7.0, 15.0)
    assert evaluate(block, outputs=["time"]) == {"time": 0.0}


def test_a_missing_input_is_refused_only_where_it_is_needed():
    at = Bench(Plain(), u=[3.0, 4.0])
    assert at.output("time") == 0.0
    with pytest.raises(InputError, match=r"^Plain: the output 'length' needs word, .*"):
        at.output("length")
    assert at.set(word="ab").output("length") == 10.0


FAULTS: list[tuple[dict[str, Any], str]] = [
    (
        {"ranges": [1.0, 2.0]},
        "ranges has 2 elements; it needs 3 elements (m); write ranges=[0.0, 0.0, 0.0]",
    ),
    ({"ranges": [[1.0, 2.0, 3.0]]}, "ranges has the shape (1, 3); it needs"),
    ({"ranges": "near"}, "ranges is 'near', which is not a list of numbers"),
    (
        {"range": 1.0},
        "has no input port 'range' (did you mean 'ranges'?); its input ports are",
    ),
    (
        {"ranges": [1.0] * 3},
        "the output 'collision_vectors_B' needs echo, which has no value; write echo=",
    ),
    ({"outputs": ["mark"]}, "has no output port 'mark' (did you mean 'mask'?)"),
    ({"state": [1.0]}, "has no state of numbers; remove state="),
]


@pytest.mark.parametrize(("inputs", "message"), FAULTS)
def test_messages_name_block_and_port_and_what_to_type(inputs, message):
    with pytest.raises(InputError, match=f"^CollisionVector: {re.escape(message)}"):
        evaluate(CollisionVector(), **inputs)


def test_a_state_of_the_wrong_size_names_its_elements():
    with pytest.raises(
        InputError, match=r"needs 7 \(x, y, theta, .*state=\[0.0\] \* 7"
    ):
        evaluate(DiffDrivePlant(), state=[0.0], wheel_speeds=[0.0, 0.0])


def test_a_linear_system_is_simulated_as_by_python_control():
    """Inputs are constant during a tick, like those of the sampled system."""
    system = LinearSystem(A, B, C, D)
    sampled = control.c2d(control.ss(A, B, C, D), 0.025, "zoh")
    u = np.random.default_rng(3).normal(size=81)
    start = [0.5, -1.0]
    expected = control.forced_response(sampled, U=u, X0=start, return_x=True)
    for given in (u, u[:, None], lambda t: u[round(t / 0.025)]):
        history = run(system, 2.0, state=start, u0=given)
        np.testing.assert_allclose(history.t, 0.025 * np.arange(81), atol=1e-12)
        np.testing.assert_allclose(history["y0"], expected.outputs.T, atol=1e-6)
        np.testing.assert_allclose(history.state, expected.states.T, atol=1e-6)
    with pytest.raises(InputError, match=r"u0 has 80 rows; .* 81 in all"):
        run(system, 2.0, u0=u[:80])


def test_rows_are_those_before_the_update_of_their_tick():
    history = run(WheelCommand(), 0.05, acceleration_W=[2.0, 0.0],
                  pose_WB_estimated=[0, 0, 0], outputs=["v_WP"])  # fmt: skip
    assert [*history] == ["v_WP"]
    assert history["v_WP"][:, 0] == pytest.approx([0.0, 0.05, 0.1])
    assert run(Integrator(1), 1.0, tick_s=0.5, u0=2.0)["y0"][:, 0] == pytest.approx(
        [0.0, 1.0, 2.0]
    )


def test_ticks_do_not_miss_updates_however_many():
    at = Bench(Counter())
    for k in range(1, 400):
        at.tick(step=1.0)
        assert at.state.seen == [k], at.time_s
    assert at.time_s == pytest.approx(39.9)
    for start_s in (0.3, 0.7):
        late = Bench(Counter(), time_s=start_s).tick(step=1.0).tick()
        assert late.state.seen == [2]
        assert late.time_s == pytest.approx(start_s + 0.2)


def test_a_state_that_is_a_named_tuple_is_set_and_published():
    at = Bench(Counter(), state=Counts(np.array([5.0])), step=2.0)
    assert at.output("sum") == 5.0
    assert at.tick().output("sum") == 7.0
    assert at.tick().state.seen == [9.0]
    with pytest.raises(InputError, match="it needs a Counts"):
        at.state = [1.0]
    with pytest.raises(InputError, match="call tick"):
        at.next_state()


def test_a_diagram_is_a_block_too():
    builder = DiagramBuilder()
    gain, whole = builder.AddSystem(Gain(3.0, 1)), builder.AddSystem(Integrator(1))
    builder.Connect(gain.get_output_port(), whole.get_input_port())
    builder.ExportInput(gain.get_input_port(), "in")
    builder.ExportOutput(whole.get_output_port(), "out")
    diagram = builder.Build()
    inputs: dict[str, Any] = {"in": 2.0}
    history = run(diagram, 1.0, **inputs)
    assert history["out"][-1] == pytest.approx([6.0])
    assert_linearization(diagram, **inputs, model=control.ss(0.0, 3.0, 1.0, 0.0))
    assert_linearization(diagram, **inputs)


def test_right_derivatives_pass_and_wrong_ones_are_named():
    assert_linearization(Square(), x=[3.0, -1.0])
    message = re.escape(
        "Square: d square[0] / d x[0] is 6.006 by automatic differentiation, and 6 by"
    )
    with pytest.raises(AssertionError, match=message):
        assert_linearization(Square(wrong=1.001), x=[3.0, -1.0])
    assert_linearization(Square(wrong=1.001), x=[3.0, -1.0], hold="x[0]")
    assert_linearization(Square(wrong=1.001), x=[3.0, -1.0], tolerance=0.01)
    with pytest.raises(AssertionError, match=r"not smooth here, .* are -1 and 1: "):
        assert_linearization(Square(), x=[3.0, 0.0])
    with pytest.raises(InputError, match="hold: 'y' is no given input"):
        assert_linearization(Square(), x=[3.0, 1.0], hold=["y"])


def test_a_linear_model_is_compared_with_the_block():
    system = LinearSystem(A, B, C, D)
    assert_linearization(system, u0=[0.3], state=[1.0, 2.0], model=system)
    wrong = control.ss(A, 1.001 * B, C, D)
    message = r"d rate of state\[1\] / d u0\[0\] is 1.001 by the linear model, and 1 by"
    with pytest.raises(AssertionError, match=message):
        assert_linearization(system, u0=[0.3], model=wrong)
    with pytest.raises(InputError, match=r"model.C: has the shape \(1, 2\)"):
        assert_linearization(system, u0=0.3, model=control.ss(A, B, C[:1], D[:1]))
    with pytest.raises(InputError, match="Counter: does not convert to AutoDiffXd"):
        assert_linearization(Counter(), step=1.0)


QUICK: dict[str, Any] = {"hearing": "ideal", "duration_s": 1.0}


def test_a_driven_quantity_reaches_the_blocks_and_the_table():
    """The virtual mass at rest gets a known acceleration."""
    drives = {"acceleration_W": lambda t: [0.2 * (t < 0.5), 0.0]}
    found = drive("obstacle_free", drives, **QUICK).trajectory
    assert found["v_WP_x"][19] == pytest.approx(0.2 * 0.5)
    assert found["v_WP_x"].iloc[-1] == pytest.approx(0.2 * 0.5)
    plain = phonotaxis.simulate("obstacle_free", **QUICK)
    placed = drive("obstacle_free", {"p_PS_B": [2.0, 0.5]}, **QUICK)
    assert [*placed.columns] == [*plain.columns]
    np.testing.assert_array_equal(placed.columns["p_PS_B_y"], 0.5)
    kept = {"p_WS_estimated": lambda t: [2.0, 0.0]}
    bearing = drive("obstacle_free", kept, **QUICK).columns["source_bearing_true"]
    np.testing.assert_array_equal(bearing[0], plain.columns["source_bearing_true"][0])


@pytest.mark.parametrize(
    ("scenario", "signals", "message"),
    [
        ("wall", {"target_vali": 1.0}, "target_vali: no block .* 'target_valid'"),
        ("wall", {"target_valid": [1, 0]}, "has 2 elements at 0 s; it needs 1 "),
        ("two_followers", {"target_valid": 1.0}, "write robot= and one of 'near', 'f"),
    ],
)
def test_signals_that_fit_nothing_are_refused(scenario, signals, message):
    with pytest.raises(InputError, match=message):
        drive(scenario, signals, hearing="ideal")
