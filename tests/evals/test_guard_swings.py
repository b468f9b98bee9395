"""Drivers that swing so that the odometry drifts: it must not, and nothing is touched.

The drivers are those of ``analysis/safety/swinging_drivers.py``, in runs of minutes.
Runs of an hour are what ``phonotaxis falsify --long`` does.
"""

from __future__ import annotations

import numpy as np
import pytest

from analysis.safety.driver_trials import Trial, run_result
from analysis.safety.long_runs import FOUR_BOXES, long_run
from analysis.safety.swinging_drivers import (
    BY_HAND,
    odometry_error,
    swing_alone,
    swing_at_boxes,
    swing_once,
)

#: What the theorem leaves to the body, m: the least margin less the coasting.
LEAST_M = 0.003 - 0.00044
#: A body that was never nearer than this was not driven at anything, m.
NEAR_M = 0.15


def again_and_again(setting: str, hz: float) -> Trial:
    """Swings between two boxes, and presses at one of them every 84 s."""
    names = "two boxes", "swing, by hand", setting
    boxes, swing = FOUR_BOXES[:2], BY_HAND._replace(hz=hz)
    return swing_at_boxes(names, boxes, swing, 300.0)


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["plain", "cells of 2 cm", "tick of 50 ms"])
def test_after_minutes_of_swings_a_box_is_not_touched(setting):
    run = long_run(swing_once(setting))
    assert not np.isfinite(run.contact_s)
    assert LEAST_M <= run.clearance_m < NEAR_M


@pytest.mark.slow
@pytest.mark.parametrize(
    ("setting", "hz"),
    [("plain", 3.18), ("tick of 50 ms", 1.0), ("tick of 50 ms", 3.18)],
)
def test_swings_and_presses_by_turns_touch_no_box(setting, hz):
    run = long_run(again_and_again(setting, hz))
    assert not np.isfinite(run.contact_s)
    assert LEAST_M <= run.clearance_m < NEAR_M


@pytest.mark.slow
@pytest.mark.parametrize("tick_s", [0.0125, 0.025, 0.05])
@pytest.mark.parametrize("hz", [0.1, 1.0, 3.18, 5.0, 10.0])
def test_exact_encoders_keep_to_the_true_path(hz, tick_s):
    """One minute of swings; an hour may take the place away by 1 mm."""
    setting = {0.0125: "tick of 12.5 ms", 0.025: "plain", 0.05: "tick of 50 ms"}[tick_s]
    trial = swing_alone(BY_HAND._replace(hz=hz), setting, 68.0)
    exact = {"plant": {"pulses_per_revolution": None}}
    assert odometry_error(run_result(trial, exact)).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    "seconds", [600.0, pytest.param(3600.0, marks=pytest.mark.long)]
)
def test_exact_encoders_keep_to_the_true_path_for_an_hour(seconds):
    trial = swing_alone(BY_HAND, "encoders not rounded", seconds)
    result = run_result(trial)
    assert result.simulated_s == pytest.approx(seconds)
    assert odometry_error(result).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["plain", "tick of 50 ms"])
def test_encoders_in_whole_pulses_stay_near_the_true_path(setting):
    """A pulse is 0.35 mrad of heading: 0.25 mm/s at most if all errors had one sign."""
    error = odometry_error(run_result(swing_alone(BY_HAND, setting, 188.0)))
    assert error.max() < 0.005
