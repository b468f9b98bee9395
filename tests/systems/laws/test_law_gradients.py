"""Every law's AutoDiff gradient against derivatives worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from phonotaxis.testing import evaluate
from systems import (
    ActiveImpedance2017Controller,
    ActiveImpedanceController,
    ConventionalImpedance2017Controller,
    ConventionalImpedanceController,
)
from systems.laws.active import ActiveParameters, active_force
from systems.laws.active_2017 import Active2017Parameters, active_2017_force
from systems.laws.conventional import ConventionalParameters, conventional_force
from systems.laws.conventional_2017 import (
    Conventional2017Parameters,
    conventional_2017_force,
)

pytestmark = pytest.mark.drake

#: Nearer than this to a kink a law has two derivatives, m or m/s.
KINK = 1e-6

#: Least range of the sensors, m, and the law of 2017 that is bounded by it.
LEAST = 0.03


def conventional_2017(c, s, gains):
    return conventional_2017_force(c, s, gains, LEAST)


def active_gains(K_0, r, rho_0, D_0, q, mu_0):
    return ActiveParameters(
        matched_stiffness_n_m=K_0,
        reference_stiffness_n_m=r * K_0,
        reach_m=rho_0,
        matched_damping_n_s_m=D_0,
        reference_damping_n_s_m=D_0 / q,
        speed_limit_m_s=mu_0,
    )


def conventional_slopes(c, s, gains):
    if c >= gains.reach_m:
        return 0.0, 0.0
    return -gains.stiffness_n_m, gains.damping_n_s_m


def active_slopes(c, s, gains):
    """k e^(-c/a) (1 - c/a) and d e^(s/b) ((mu_0 - s)/b - 1)."""
    k, a = gains.reference_stiffness_n_m, gains.alpha_m
    d, b, mu_0 = gains.reference_damping_n_s_m, gains.beta_m_s, gains.speed_limit_m_s
    by_c = k * math.exp(-c / a) * (1.0 - c / a)
    by_s = d * math.exp(s / b) * ((mu_0 - s) / b - 1.0) if s < mu_0 else 0.0
    return by_c, by_s


def conventional_2017_slopes(c, s, gains):
    by_c = -gains.distance_gain_j / c**2 if c > LEAST else 0.0
    return by_c, gains.damping_n_s_m


def active_2017_slopes(c, s, gains):
    near, fast = gains.saturation_distance_m, gains.saturation_speed_m_s
    by_c = -gains.distance_gain_j / c**2 if c > near else 0.0
    return by_c, gains.damping_n_s_m if s < fast else 0.0


class Law(NamedTuple):
    """A law, its derivatives by c and s, and the places of its kinks."""

    force: Callable[..., Any]
    slopes: Callable[..., tuple[float, float]]
    gains: st.SearchStrategy[Any]
    kink_c: str | float | None
    kink_s: str | float | None


LAWS = {
    "conventional": Law(
        conventional_force,
        conventional_slopes,
        st.builds(
            ConventionalParameters,
            stiffness_n_m=st.floats(1, 99),
            damping_n_s_m=st.floats(0.1, 9),
            reach_m=st.floats(0.2, 3),
        ),
        "reach_m",
        None,
    ),
    "active": Law(
        active_force,
        active_slopes,
        st.builds(
            active_gains,
            *(st.floats(1, 99), st.floats(1.1, 9), st.floats(0.2, 3)),
            *(st.floats(0.1, 9), st.floats(1.1, 9), st.floats(0.1, 3)),
        ),
        None,
        "speed_limit_m_s",
    ),
    "conventional2017": Law(
        conventional_2017,
        conventional_2017_slopes,
        st.builds(
            Conventional2017Parameters,
            distance_gain_j=st.floats(0.1, 9),
            damping_n_s_m=st.floats(0.1, 9),
        ),
        LEAST,
        None,
    ),
    "active2017": Law(
        active_2017_force,
        active_2017_slopes,
        st.builds(
            Active2017Parameters,
            distance_gain_j=st.floats(0.1, 9),
            saturation_distance_m=st.floats(0.02, 0.5),
            damping_n_s_m=st.floats(0.1, 9),
            saturation_speed_m_s=st.floats(0.1, 3),
        ),
        "saturation_distance_m",
        "saturation_speed_m_s",
    ),
}


def place(kink: str | float, gains: Any) -> float:
    """Where a kink is, m or m/s: one of the gains, or the same for all."""
    return float(getattr(gains, kink)) if isinstance(kink, str) else kink


@pytest.mark.parametrize("law", LAWS)
@given(data=st.data(), c=st.floats(0.01, 3.0), s=st.floats(0.0, 3.0))
def test_autodiff_equals_the_derivatives_by_hand(law, data, c, s):
    force, slopes, any_gains, *kinks = LAWS[law]
    gains = data.draw(any_gains)
    for value, kink in zip((c, s), kinks, strict=True):
        assume(kink is None or abs(value - place(kink, gains)) > KINK)
    point: Any = np.array([c, s])
    dual = force(*InitializeAutoDiff(point).ravel(), gains)
    assert dual.value() == pytest.approx(force(c, s, gains), rel=1e-12)
    np.testing.assert_allclose(
        dual.derivatives(), slopes(c, s, gains), rtol=1e-9, atol=1e-12
    )


BLOCKS: dict[str, tuple[Any, Any]] = {
    "conventional": (ConventionalImpedanceController(), ConventionalParameters()),
    "active": (ActiveImpedanceController(), ActiveParameters()),
    "conventional2017": (
        ConventionalImpedance2017Controller(),
        Conventional2017Parameters(),
    ),
    "active2017": (ActiveImpedance2017Controller(), Active2017Parameters()),
}
DUALS = {law: block.ToAutoDiffXd() for law, (block, _) in BLOCKS.items()}


@pytest.mark.parametrize("law", LAWS)
@given(c=st.floats(0.05, 3.0), direction=st.floats(-math.pi, math.pi))
def test_block_s_stiffness_is_radial_slope_and_tangential_secant(law, c, direction):
    """F = -f(c) C/c has dF/dC = -f' u u' - (f/c)(1 - u u'), u = C/c; s = 0."""
    force, slopes, _, kink, _ = LAWS[law]
    gains = BLOCKS[law][1]
    assume(kink is None or abs(c - place(kink, gains)) > KINK)
    u = np.array([math.cos(direction), math.sin(direction)])
    C = InitializeAutoDiff(c * u).ravel()
    outputs = evaluate(
        DUALS[law],
        p_WS_estimated=[5.0, 0.0],
        target_valid=[0.0],
        collision_vectors_B=[*C, 0, 0, 0, 0],
        features=[1, 0, 0],
        pose_WB_estimated=[0, 0, 0],
        v_WP=[0, 0],
    )
    nothing = 0.0 * C[0]
    F_b = np.array([[F + nothing] for F in outputs["forces_W"][2:]])
    radial, along = slopes(c, 0.0, gains)[0], np.outer(u, u)
    expected = -radial * along - force(c, 0.0, gains) / c * (np.eye(2) - along)
    np.testing.assert_allclose(ExtractGradient(F_b), expected, rtol=1e-6, atol=1e-6)
