"""The gains of the laws: what derives from what, and what is refused."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from systems.laws.active import ActiveParameters, matched_decay


def test_matched_decay_of_a_ratio_of_e():
    assert matched_decay(0.8, math.e) == pytest.approx(0.4)


def test_alpha_and_beta_of_the_papers_numbers():
    """Han 2019, eq. 21; 22 with D_0 and d_ref."""
    gains = ActiveParameters(
        matched_stiffness_n_m=10.0,
        reference_stiffness_n_m=40.0,
        matched_damping_n_s_m=3.0,
        reference_damping_n_s_m=1.0,
        speed_limit_m_s=0.6,
    )
    assert gains.alpha_m == pytest.approx(0.8 / (2 * math.log(4)))
    assert gains.beta_m_s == pytest.approx(0.6 / (2 * math.log(3)))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"reference_stiffness_n_m": 16.0, "matched_stiffness_n_m": 16.0},
            r"reference_stiffness_n_m: 16.0 \(k_ref\) is not above .* raise it",
        ),
        (
            {"reference_damping_n_s_m": 0.8, "matched_damping_n_s_m": 0.8},
            r"reference_damping_n_s_m: 0.8 \(d_ref\) is not below .* lower it",
        ),
    ],
)
def test_laws_that_cannot_match_are_refused(settings, message):
    with pytest.raises(ValidationError, match=message):
        ActiveParameters(**settings)
