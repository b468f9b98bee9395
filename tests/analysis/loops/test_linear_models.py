"""Linear models against closed forms and python-control."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.loops.linear_models import LinearModel, minimal_model, simple_poles


def spring(k: float, d: float, period: float | None = None) -> LinearModel:
    """A unit mass on a spring and a damper, pushed; position out."""
    A, B = np.array([[0.0, 1.0], [-k, -d]]), np.array([[0.0], [1.0]])
    C, D = np.array([[1.0, 0.0]]), np.zeros((1, 1))
    if period:
        sampled = control.sample_system(control.ss(A, B, C, D), period)
        A, B, C, D = control.ssdata(sampled)
    names = ("position", "speed"), ("push",), ("position",)
    return LinearModel("spring", A, B, C, D, *names, period_s=period)


@given(st.floats(0.5, 20.0), st.floats(0.01, 0.99), st.sampled_from([None, 0.025]))
def test_modes_have_the_oscillators_frequency_and_damping(omega, zeta, period):
    (mode,) = spring(omega**2, 2 * zeta * omega, period).modes
    assert mode.frequency_rad_s == pytest.approx(omega, rel=1e-9)
    assert mode.damping_ratio == pytest.approx(zeta, rel=1e-8)
    assert mode.time_constant_s == pytest.approx(1 / (zeta * omega), rel=1e-8)
    assert mode.settling_s == pytest.approx(4 / (zeta * omega), rel=1e-8)
    assert sum(mode.participation.values()) == pytest.approx(1.0)


@given(st.floats(0.5, 20.0), st.floats(-0.5, 0.99), st.sampled_from([None, 0.025]))
def test_model_has_the_growth_and_damping_of_the_oscillator(omega, zeta, period):
    model = spring(omega**2, 2 * zeta * omega, period)
    pole = complex(-zeta * omega, omega * math.sqrt(1.0 - zeta**2))
    pair = sorted([pole, pole.conjugate()], key=lambda s: s.imag)
    found = sorted(model.s_poles.tolist(), key=lambda s: s.imag)
    np.testing.assert_allclose(found, pair, rtol=1e-7)
    assert model.growth_per_s == pytest.approx(-zeta * omega, rel=1e-6, abs=1e-9)
    assert model.damping_ratio == pytest.approx(zeta, rel=1e-6, abs=1e-9)
    if zeta > 1e-6:
        assert model.stable
        assert model.settling_s == pytest.approx(4.0 / (zeta * omega), rel=1e-6)
    if zeta < -1e-6:
        assert not model.stable
        assert model.settling_s == math.inf


def test_delays_have_no_pole_in_the_s_plane():
    """Two ticks of delay behind a lag that keeps half of its value per tick."""
    A = np.array([[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    model = LinearModel(
        "late lag", A, np.eye(3), np.eye(3), np.zeros((3, 3)),
        ("lag", "once", "twice"), ("a", "b", "c"), ("d", "e", "f"), period_s=0.1,
    )  # fmt: skip
    np.testing.assert_allclose(model.s_poles, [math.log(0.5) / 0.1])
    assert model.spectral_radius == pytest.approx(0.5)
    assert model.growth_per_s == pytest.approx(math.log(0.5) / 0.1)
    assert model.damping_ratio == 1.0


def test_a_model_is_printed_with_its_poles():
    # s^2 + s + 1 has the roots -1/2 +/- j sqrt(3)/2.
    A, B, C = np.array([[0.0, 1.0], [-1.0, -1.0]]), np.ones((2, 1)), np.ones((1, 2))
    model = LinearModel("loop", A, B, C, np.zeros((1, 1)), ("x", "v"), ("u",), ("y",))
    assert str(model).splitlines() == [
        "loop: 2 states, continuous",
        "inputs: u; outputs: y",
        "poles (rad/s): -0.5 +/- 0.866j",
    ]


def test_participation_tells_states_apart():
    """Two masses that do not know of each other."""
    A = np.array([[-1.0, 0.0], [0.0, -5.0]])
    model = LinearModel(
        "two", A, np.eye(2), np.eye(2), np.zeros((2, 2)),
        ("slow", "fast"), ("a", "b"), ("c", "d"),
    )  # fmt: skip
    assert [list(mode.participation) for mode in model.modes] == [["slow"], ["fast"]]


@pytest.mark.parametrize("period", [None, 0.025])
def test_response_is_that_of_control(period):
    model = spring(4.0, 0.3, period)
    omega = np.array([0.1, 1.0, 2.0, 30.0])
    ours = model.response(omega)[0, 0]
    theirs = control.frequency_response(model.to_control(), omega).complex
    np.testing.assert_allclose(ours, np.squeeze(theirs), rtol=1e-10)


def test_signals_keep_their_names():
    system = spring(4.0, 0.3, 0.025).to_control()
    assert (system.input_labels, system.output_labels) == (["push"], ["position"])
    assert system.state_labels == ["position", "speed"]
    assert system.dt == 0.025


def test_part_takes_signals_by_name():
    model = spring(4.0, 0.3)
    both = LinearModel(
        "both", model.A, np.hstack([model.B, 2 * model.B]), np.eye(2), np.zeros((2, 2)),
        model.state_names, ("one", "two"), ("position", "speed"),
    )  # fmt: skip
    part = both.part(["two"], ["position"])
    np.testing.assert_allclose(part.response([1.0]), 2 * model.response([1.0]))


def test_simple_poles_leaves_out_zeros_and_neighbors():
    poles = np.array([0.0, 0.5, 0.5 + 1e-9, 0.9, 0.2 + 0.1j], dtype=complex)
    np.testing.assert_allclose(simple_poles(poles), [0.9, 0.2 + 0.1j])


@given(
    st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(0, 3), st.integers(0, 3)
)
def test_reduction_keeps_the_response_and_drops_what_is_hidden(
    seed, n, unseen, unmoved
):
    """Random stable parts that are not moved or not seen, mixed by a rotation."""
    rng = np.random.default_rng(seed)
    size = n + unseen + unmoved
    A = np.diag(rng.uniform(-3, -0.2, size))
    A[:n, :n] += np.diag(rng.uniform(0.5, 1, n - 1), 1)
    A[n : n + unseen, :n] = rng.normal(size=(unseen, n))  # moved, not seen
    B, C = np.zeros((size, 1)), np.zeros((1, size))
    B[n - 1, 0] = C[0, 0] = 1.0
    C[0, n + unseen :] = 1.0  # seen, not moved
    turn = np.linalg.qr(rng.normal(size=(size, size)))[0]
    names = tuple(f"x{k}" for k in range(size))
    whole = LinearModel(
        "whole", turn @ A @ turn.T, turn @ B, C @ turn.T, np.zeros((1, 1)),
        names, ("u",), ("y",),
    )  # fmt: skip
    small = minimal_model(whole)
    assert len(small.A) == n
    omega = [0.1, 1.0, 7.0]
    np.testing.assert_allclose(small.response(omega), whole.response(omega), atol=1e-8)


def test_neutral_poles_have_no_settling_time():
    model = LinearModel(
        "integrator", np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)),
        np.zeros((1, 1)), ("x",), ("u",), ("y",),
    )  # fmt: skip
    (mode,) = model.modes
    assert math.isnan(mode.damping_ratio)
    assert mode.settling_s == math.inf
