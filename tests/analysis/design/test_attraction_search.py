"""Follow distance and damping: the defaults again, and closed forms."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from analysis.design.attraction_search import (
    attraction_damping_ratio,
    braking_overshoot,
    follow_distance,
    following_lag,
)
from analysis.design.requirements import DesignRequirements
from diagrams.scenario.scenario import Scenario

SCENARIO, REQUIREMENTS = Scenario(), DesignRequirements()


def changed(part: str, **changes) -> Scenario:
    if part == "stop":
        stop = SCENARIO.stop.model_copy(update=changes)
        return SCENARIO.model_copy(update={"stop": stop})
    parameters = getattr(SCENARIO.follower, part).model_copy(update=changes)
    return SCENARIO.with_robot(**{part: parameters})


def test_damping_ratio_of_the_printed_gains():
    """0.160 with the motors' lag, found by independent code."""
    assert attraction_damping_ratio(SCENARIO) == pytest.approx(0.160, abs=1e-3)


def test_damping_ratio_without_lag_is_that_of_the_sampled_mass():
    """z^2 - (2 - d - k) z + 1 - d with d = D_r T/M, k = K_r T^2/M."""
    d, k = 1.0 * 0.025 / 3.94, 2.0 * 0.025**2 / 3.94
    s = cmath.log(np.roots([1.0, d + k - 2.0, 1.0 - d])[0])
    scenario = changed("plant", motor_lag_s=1e-6)
    assert attraction_damping_ratio(scenario) == pytest.approx(
        -s.real / abs(s), rel=1e-4
    )


def test_lag_behind_a_moving_source():
    assert following_lag(SCENARIO) == pytest.approx(0.15)
    assert following_lag(changed("attraction", damping_n_s_m=4.0)) == pytest.approx(0.6)


def test_default_follow_distance_has_room_for_the_overshoot():
    """0.76 m past a resting source, half the master robot, and 0.25 m."""
    overshoot = braking_overshoot(SCENARIO)
    assert overshoot == pytest.approx(0.76, abs=0.005)
    found = follow_distance(SCENARIO, REQUIREMENTS, overshoot)
    assert found == SCENARIO.follower.attraction.follow_distance_m == 1.2


def test_damping_spares_the_room():
    """Critically damped: the lag of the motors alone."""
    stiff = changed("attraction", stiffness_n_m=2.0, damping_n_s_m=5.7)
    assert attraction_damping_ratio(stiff) > 0.95
    overshoot = braking_overshoot(stiff)
    assert overshoot < 0.03
    found = follow_distance(stiff, REQUIREMENTS, overshoot)
    assert found == pytest.approx(0.45)
