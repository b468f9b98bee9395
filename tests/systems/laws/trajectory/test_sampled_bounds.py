"""The closed form of a sampled axis, against its integral and against conditions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from systems.laws.trajectory.sampled_bounds import (
    SampledMass,
    damping_bound,
    pull_through_m,
    rate_bound,
    sampled_matrix,
    stiffness_bound,
)
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)

BUILT = SampledMass(1.0, 0.05, 0.025)


def test_a_tick_is_that_of_the_motors_differential_equation():
    """lag w' = v - w, p' = w over a tick, from a state in which nothing is 0."""
    p, w, v = 0.3, -0.1, 0.2
    stiffness, damping, of = 7.0, 3.0, SampledMass(2.0, 0.04, 0.03)
    v_next = v - of.tick_s / of.mass_kg * (stiffness * p + damping * v)
    moved = solve_ivp(
        lambda t, x: [x[1], (v_next - x[1]) / of.motor_lag_s],
        (0.0, of.tick_s),
        [p, w],
        rtol=1e-12,
        atol=1e-14,
    ).y[:, -1]
    found = sampled_matrix(stiffness, damping, of) @ [p, w, v]
    np.testing.assert_allclose(found, [*moved, v_next], rtol=1e-10)


def test_late_places_are_kept_as_long_as_they_are_late():
    late = BUILT._replace(late_ticks=2)
    matrix, state = sampled_matrix(5.0, 4.0, late), np.array([1.0, 0, 0, 2.0, 3.0])
    after = matrix @ state
    assert after[2] == pytest.approx(-0.025 * 5.0 * 3.0)
    np.testing.assert_allclose(after[3:], [1.0, 2.0])


@pytest.mark.parametrize(
    ("late", "bound"),
    [
        # Held velocity without lag: 2 D T + K T^2 < 4, a tick late K T < D.
        (0, lambda d, t: (4.0 - 2.0 * d * t) / t**2),
        (1, lambda d, t: d / t),
    ],
)
def test_without_lag_the_bound_is_a_closed_condition(late, bound):
    of = SampledMass(1.0, 1e-6, 0.025, late)
    for damping in (0.5, 4.0, 20.0):
        expected = bound(damping, of.tick_s)
        assert stiffness_bound(damping, of) == pytest.approx(expected, rel=1e-3)


def test_in_continuous_time_the_bound_is_rouths():
    """K < D/lag + D^2/M."""
    of = SampledMass(2.0, 0.1, 1e-5)
    assert stiffness_bound(3.0, of) == pytest.approx(30.0 + 4.5, rel=1e-3)


def test_bounds_of_the_design():
    late = BUILT._replace(late_ticks=1)
    assert stiffness_bound(4.0, late) == pytest.approx(60.9, abs=0.05)
    assert damping_bound(BUILT) == pytest.approx(80.0)
    assert stiffness_bound(80.0, BUILT) == 0.0
    assert math.ceil((damping_bound(BUILT) - 4.0) / 4.0) - 1 == 18


def test_the_rate_falls_with_the_square_of_the_amplitude():
    own = TrajectoryImpedanceParameters(
        stiffness_n_m=3.0, contact_stiffness_n_m=6.0, security_zone_m=0.5
    )
    assert pull_through_m(own) == pytest.approx(1.0)
    alone = own.model_copy(update={"contact_stiffness_n_m": 0.0})
    assert pull_through_m(alone) == 1.0
    rates = [rate_bound("lyapunov", a, BUILT) for a in (1.0, 2.0)]
    assert rates == pytest.approx([1600.0, 400.0])
