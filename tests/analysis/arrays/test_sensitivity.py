"""What errors of the array cost: against moved delays, and in sound."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.arrays.sensitivity import ArrayErrors, measured_std, predicted_std
from analysis.arrays.single_frames import Loudspeaker, frame_estimator
from systems.base.robot import RobotParameters
from systems.hearing.multilateration import locate_source
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
ROW = ArrayShape.of(RobotParameters().microphones_m)


def place(distance: float, bearing_deg: float) -> np.ndarray:
    angle = math.radians(bearing_deg)
    return distance * np.array([math.cos(angle), math.sin(angle)])


def located(p_AS, p_AM, shape, late=0.0, c=C) -> np.ndarray:
    """Bearing and range that noise-free delays of another array lead to."""
    times = np.linalg.norm(p_AS - p_AM, axis=1) / c - late
    count = shape.count - 1
    covariance = 1e-14 * (np.eye(count) + np.ones((count, count)))
    fix = locate_source(times[1:] - times[0], covariance, shape, C)
    return np.array([fix.bearing, fix.range])


def by_differences(errors: ArrayErrors, p_AS, shape) -> np.ndarray:
    """Standard deviations from one small error at a time."""
    small = 1e-4
    columns = []
    for k in range(shape.p_AM.size):
        move = small * errors.position_m * np.eye(shape.p_AM.size)[k]
        moved = shape.p_AM + move.reshape(shape.p_AM.shape)
        columns.append(located(p_AS, moved, shape))
    lates = small * errors.delay_s * np.eye(shape.count)
    columns += [located(p_AS, shape.p_AM, shape, late) for late in lates]
    faster = C * (1.0 + small * errors.sound_speed_share)
    columns.append(located(p_AS, shape.p_AM, shape, c=faster))
    moves = np.array(columns) - located(p_AS, shape.p_AM, shape)
    return np.linalg.norm(moves, axis=0) / small


@given(
    distance=st.floats(0.8, 5.0),
    bearing_deg=st.floats(-65.0, 65.0),
    sizes=st.tuples(*[st.floats(0.0, 1.0)] * 3),
)
def test_prediction_is_the_derivative(distance, bearing_deg, sizes):
    errors = ArrayErrors(1e-4 * sizes[0], 1e-7 * sizes[1], 1e-3 * (sizes[2] + 0.1))
    p_AS = place(distance, bearing_deg)
    predicted = predicted_std(errors, p_AS, ROW, C)
    expected = by_differences(errors, p_AS, ROW)
    assert predicted.bearing == pytest.approx(expected[0], rel=1e-3, abs=1e-8)
    assert predicted.range == pytest.approx(expected[1], rel=1e-3, abs=1e-7)


@pytest.mark.parametrize(
    ("errors", "distance", "range_cm", "range_cm_at_60"),
    [
        (ArrayErrors(position_m=1e-3), 2.0, 7.8, 25.0),
        (ArrayErrors(position_m=2e-4), 2.0, 1.6, None),
        (ArrayErrors(position_m=2e-4), 4.0, 5.9, None),
        (ArrayErrors(delay_s=1e-6), 2.0, 2.2, 8.0),
        (ArrayErrors(delay_s=1e-6), 4.0, 9.3, 35.0),
        (ArrayErrors(sound_speed_share=0.01), 2.0, 2.8, 14.0),
        (ArrayErrors(sound_speed_share=0.01), 4.0, 5.4, 28.0),
    ],
)
def test_figures_of_an_independent_simulation(
    errors, distance, range_cm, range_cm_at_60
):
    """Rms over 0 and 30 deg, from trials of which each figure has about 10 %."""
    stds = [
        100.0 * predicted_std(errors, place(distance, bearing), ROW, C).range
        for bearing in (0.0, 30.0, 60.0)
    ]
    assert math.sqrt(np.mean(np.square(stds[:2]))) == pytest.approx(range_cm, rel=0.15)
    if range_cm_at_60 is not None:
        assert stds[2] == pytest.approx(range_cm_at_60, rel=0.1)


def test_c_wrong_by_one_percent_turns_the_bearing():
    """An angle from broadside grows by its tangent's share: far away, tan/100."""
    errors = ArrayErrors(sound_speed_share=0.01)
    far = predicted_std(errors, place(1e3, 45.0), ROW, C)
    assert far.bearing == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize(
    "errors",
    [
        ArrayErrors(position_m=2e-4),
        ArrayErrors(delay_s=2e-7),
        ArrayErrors(sound_speed_share=2e-3),
    ],
)
def test_measured_in_sound_as_predicted(errors):
    """The central 68 % of 400 Gaussian draws spread to 5 %."""
    p_AS = place(2.0, 30.0)
    measured = measured_std(
        errors, p_AS, ROW, C, loudspeaker=Loudspeaker.of("chirp", 3),
        estimate=frame_estimator(TDOAParameters(), ROW, C), trials=400, seed=1,
    )  # fmt: skip
    predicted = predicted_std(errors, p_AS, ROW, C)
    assert measured.range == pytest.approx(predicted.range, rel=0.2)
    assert measured.bearing == pytest.approx(predicted.bearing, rel=0.2)


def test_gains_cost_nothing():
    """1 dB moves range by less than a tenth of what 0.2 mm does."""
    errors = ArrayErrors(gain_db=1.0)
    p_AS = place(3.0, 30.0)
    measured = measured_std(
        errors, p_AS, ROW, C, loudspeaker=Loudspeaker.of("chirp", 3),
        estimate=frame_estimator(TDOAParameters(), ROW, C), trials=50, seed=1,
    )  # fmt: skip
    assert predicted_std(errors, p_AS, ROW, C).range == 0.0
    assert (
        measured.range
        < 0.1 * predicted_std(ArrayErrors(position_m=2e-4), p_AS, ROW, C).range
    )


def test_nothing_heard_is_an_error():
    with pytest.raises(ValueError, match="nothing was heard"):
        measured_std(
            ArrayErrors(), place(2.0, 0.0), ROW, C,
            loudspeaker=Loudspeaker.of("chirp", 3), estimate=lambda _frame: None,
            trials=1, seed=1,
        )  # fmt: skip
