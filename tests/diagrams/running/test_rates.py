"""Ticks, frames and firings of different periods in one diagram."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from analysis.runs.metric_table import run_metrics
from diagrams import Scenario, simulate

EXACT = {
    "hearing": "ideal_always",
    "obstacle_sensing": "ideal",
    "plant": {"pulses_per_revolution": None},
    "law": "none",
    "obstacles": [],
}
MOVING = {"waypoints_m": [[2.5, 0.6], [2.5, -3.0]], "speed_m_s": 0.3}


def run(**fields):
    return simulate(Scenario.model_validate(fields))


def target_error(result, counted):
    columns = result.columns
    return np.hypot(
        columns["p_WS_estimated_x"] - columns["p_WS_x"],
        columns["p_WS_estimated_y"] - columns["p_WS_y"],
    )[counted]


@pytest.mark.parametrize("tick_s", [0.005, 0.0125, 0.025, 0.05])
@pytest.mark.parametrize("frames", [1, 2, 5])
def test_a_resting_source_is_placed_by_the_pose_of_its_frame(tick_s, frames):
    """The robot comes at 0.4 m/s and turns: a tick too early or late are 2 to 20 mm.

    Between ticks the pose is taken for a line, which costs less than 1 mm.
    """
    fields = {"start": {"heading_deg": 60.0}, "duration_s": 3.0, **EXACT}
    fields |= {"source": {"waypoints_m": [[2.0, 0.0]]}, "tick_s": tick_s}
    fields |= {"ultrasonic": {"period_s": tick_s}}
    result = run(microphones={"frame_s": frames * tick_s}, **fields)
    assert np.hypot(result.columns["v_WB_x"], result.columns["v_WB_y"]).max() > 0.35
    valid = result.columns["target_valid"] > 0.5
    assert target_error(result, valid).max() < 1e-3


@pytest.mark.parametrize(
    ("tick_s", "microphones"),
    [
        (0.0125, {}),
        (0.005, {"frame_s": 0.025}),
        (0.025, {"frame_s": 0.1}),
        (0.025, {"sample_rate_hz": 32_000.0}),
        (0.05, {"frame_s": 0.1, "sample_rate_hz": 48_000.0}),
    ],
)
@pytest.mark.parametrize(
    ("room", "within"),
    [(None, 0.02), ({"absorption": 0.6, "maximum_order": 2}, 0.035)],
)
def test_a_moving_source_is_heard_at_any_rate(tick_s, microphones, room, within):
    """Both drive. The median error is 0.8 cm at 25 ms and 100 kHz, 2.5 cm in the room.

    Frames that hold sound are three bursts of half a second, each counted once.
    """
    fields = {"duration_s": 6.0, "source": MOVING, "room": room}
    fields |= {"tick_s": tick_s, "ultrasonic": {"period_s": tick_s}}
    result = run(microphones=microphones, **fields)
    heard = np.r_[False, result.columns["detected"][:-1] > 0.5]
    assert np.median(target_error(result, heard)) < within
    metrics = run_metrics(result)
    frames, heard_of = (
        metrics[name] for name in ("frames_with_sound", "frames_with_sound_heard")
    )
    assert frames is not None
    assert heard_of is not None
    frame_s = microphones.get("frame_s", 0.025)
    assert frames == pytest.approx(1.5 / frame_s, abs=3)
    assert heard_of / frames > 0.85


def test_a_finer_tick_converges_at_first_order():
    """Everything that is held for a tick errs in proportion to it."""
    ends = [
        run(
            duration_s=6.0,
            source=MOVING,
            tick_s=tick_s,
            microphones={"frame_s": tick_s},
            ultrasonic={"period_s": tick_s},
            integration_step_s=min(tick_s, 0.025),
            **EXACT,
        ).columns["p_WB_x"][-1]
        for tick_s in (0.05, 0.025, 0.0125, 0.00625)
    ]
    steps = np.diff(ends)
    np.testing.assert_allclose(steps[:-1] / steps[1:], 2.0, rtol=0.1)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"tick_s": 0.01},
            r"microphones\.frame_s: 0\.025 s is not a multiple of tick_s",
        ),
        ({"tick_s": 0.0125004}, r"tick_s: .* not a multiple of 1e-05 s"),
        ({"ultrasonic": {"period_s": 0.03}}, r"ultrasonic\.period_s: .*use 0\.025"),
        (
            {"microphones": {"sample_rate_hz": 22_050.0}},
            r"sample_rate_hz: 22050 Hz gives 551\.2500 samples.*use 22040",
        ),
        (
            {"robots": {"anna": {}, "berta": {"microphones": {"frame_s": 0.03}}}},
            r"robots\.berta\.microphones\.frame_s",
        ),
    ],
)
def test_rates_that_do_not_fit(fields, message):
    with pytest.raises(ValidationError, match=message):
        Scenario.model_validate(fields)


def test_a_band_beyond_half_the_sample_rate():
    fields = {"microphones": {"sample_rate_hz": 16_000.0}, "duration_s": 0.1}
    with pytest.raises(ValueError, match=r"15000 Hz must rise and end at or below"):
        run(**fields)
