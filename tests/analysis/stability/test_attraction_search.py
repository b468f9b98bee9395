"""Follow distance and damping: the defaults again, and closed forms."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from analysis.stability.attraction_search import (
    braking_overshoot,
    follow_distance,
    gain_figures,
)
from analysis.stability.requirements import Requirements
from diagrams.scenario.scenario import Scenario

SCENARIO, REQUIREMENTS = Scenario(), Requirements()


def changed(part: str, **changes) -> Scenario:
    if part == "stop":
        stop = SCENARIO.stop.model_copy(update=changes)
        return SCENARIO.model_copy(update={"stop": stop})
    parameters = getattr(SCENARIO.follower, part).model_copy(update=changes)
    return SCENARIO.with_robot(**{part: parameters})


def test_damping_ratio_of_the_printed_gains():
    """0.160 with the motors' lag, found by independent code."""
    assert gain_figures(SCENARIO, REQUIREMENTS).damping_ratio == pytest.approx(
        0.160, abs=1e-3
    )


def test_damping_ratio_without_lag_is_that_of_the_sampled_mass():
    """z^2 - (2 - d - k) z + 1 - d with d = D_r T/M, k = K_r T^2/M."""
    d, k = 1.0 * 0.025 / 3.94, 2.0 * 0.025**2 / 3.94
    s = cmath.log(np.roots([1.0, d + k - 2.0, 1.0 - d])[0])
    scenario = changed("plant", motor_lag_s=1e-6)
    assert gain_figures(scenario, REQUIREMENTS).damping_ratio == pytest.approx(
        -s.real / abs(s), rel=1e-4
    )


def test_lag_behind_a_moving_source():
    assert gain_figures(SCENARIO, REQUIREMENTS).following_lag_m == pytest.approx(0.15)
    damped = changed("attraction", damping_n_s_m=4.0)
    assert gain_figures(damped, REQUIREMENTS).following_lag_m == pytest.approx(0.6)


def test_default_follow_distance_has_room_for_the_overshoot():
    """0.76 m past a resting source, half the master robot, and 0.25 m."""
    overshoot = braking_overshoot(SCENARIO)
    assert overshoot == pytest.approx(0.76, abs=0.005)
    found = follow_distance(SCENARIO, REQUIREMENTS, overshoot)
    assert found == SCENARIO.follower.attraction.follow_distance_m == 1.2


def test_damping_spares_the_room():
    """Critically damped: the lag of the motors alone."""
    stiff = changed("attraction", stiffness_n_m=2.0, damping_n_s_m=5.7)
    assert gain_figures(stiff, REQUIREMENTS).damping_ratio > 0.95
    overshoot = braking_overshoot(stiff)
    assert overshoot < 0.03
    found = follow_distance(stiff, REQUIREMENTS, overshoot)
    assert found == pytest.approx(0.45)
