"""Harmonic balance against the simulated blocks, head-on before a box."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.loops.contact_mode import contact_model
from diagrams import load_scenario
from studies.nonlinear.contact_oscillation import contact_oscillation
from studies.nonlinear.harmonic_balance import predict_oscillation
from studies.nonlinear.head_on import head_on

GAINS = (
    "attraction.stiffness_n_m=2.0",
    "attraction.damping_n_s_m=1.0",
    "laws.conventional.damping_n_s_m=0.8",
    "laws.active.reference_stiffness_n_m=64",
    "laws.active.matched_stiffness_n_m=16",
    "laws.active.reference_damping_n_s_m=0.2",
    "laws.active.matched_damping_n_s_m=0.8",
)


def scenario(law, *overrides):
    return load_scenario("two_static_obstacles", [f"law={law}", *GAINS, *overrides])


@pytest.mark.slow
@pytest.mark.parametrize("law", ["conventional", "active"])
def test_bias_and_decay_of_a_stable_contact(law):
    case = scenario(law, "laws.conventional.stiffness_n_m=16")
    found = contact_oscillation(case, duration_s=30.0)
    for term, run in found.runs.items():
        predicted = found.predictions[term]
        assert predicted.limit_cycle is None
        # The first cycle comes from rest, the last ones are a few millimeters.
        inner = slice(1, -1)
        for amplitude, center, growth in zip(
            run.amplitudes_m[inner],
            run.centers_m[inner],
            run.growth_per_s[inner],
            strict=True,
        ):
            if amplitude < 0.01:
                continue
            expected_center, expected_growth, _ = predicted.at(float(amplitude))
            assert center == pytest.approx(expected_center, abs=2.5e-3)
            assert growth == pytest.approx(expected_growth, abs=2e-3)
        omega = predicted.at(0.05)[2]
        assert np.mean(run.frequencies_rad_s) == pytest.approx(omega, rel=0.02)


@pytest.mark.slow
def test_limit_cycle_of_a_contact_that_is_too_stiff():
    """K_0 = 20 N/m is past the limit of 18: it grows till P leaves the reach."""
    case = scenario("conventional", "laws.conventional.stiffness_n_m=20")
    found = contact_oscillation(case, to_go_m=1.0, start_m=0.75, duration_s=120.0)
    predicted, run = found.predictions["printed"], found.runs["printed"]
    assert predicted.limit_cycle is not None
    amplitude, center, frequency = predicted.limit_cycle
    assert amplitude < predicted.clamp_amplitude_m
    assert run.settled_amplitude_m == pytest.approx(amplitude, rel=0.05)
    assert run.centers_m[-3:].mean() == pytest.approx(center, abs=5e-3)
    assert run.frequencies_rad_s[-3:].mean() == pytest.approx(frequency, rel=0.02)
    assert found.runs["closing"].settled_amplitude_m < 0.02


@pytest.mark.parametrize("stiffness", [10.0, 16.0, 22.0])
def test_growth_of_small_oscillations_is_that_of_the_linear_chain(stiffness):
    """The printed term damps nothing: |z| of contact mode with K_r + K_0."""
    case = scenario("conventional", f"laws.conventional.stiffness_n_m={stiffness}")
    contact = head_on(case, to_go_m=1.0)
    small = predict_oscillation(contact, "printed", largest_m=0.01, points=1)
    radius = contact_model(case, stiffness + 2.0).spectral_radius
    assert np.exp(0.025 * small.growth_per_s[0]) == pytest.approx(radius, abs=1e-6)
