"""Ten minutes of noise, and sounds below it: what is heard, and what is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binomtest

from analysis.detection import detection_curve, noise_chances
from analysis.free_field import Loudspeaker
from systems.array_shape import ArrayShape
from systems.localise import TDOAParameters
from systems.robot import RobotParameters
from systems.signals import FRAME_PERIOD_S

pytestmark = pytest.mark.slow

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
FRAMES = round(600.0 / FRAME_PERIOD_S)


@pytest.fixture(scope="module")
def chances() -> NDArray[np.float64]:
    """Of the frames of ten minutes of noise, as in docs/localization.md."""
    return noise_chances(FRAMES, shape=SHAPE, c=C, seed=9)


def test_nothing_is_heard_in_ten_minutes_of_noise(chances):
    assert FRAMES == 24_000
    assert chances.min() > TDOAParameters().false_alarm_rate


@pytest.mark.parametrize("rate", [1e-1, 1e-2, 1e-3])
def test_false_alarms_are_no_more_than_set_and_no_tenth_of_it(chances, rate):
    """By the 95 % interval of what is counted."""
    count = int(np.count_nonzero(chances <= rate))
    measured = binomtest(count, FRAMES).proportion_ci(0.95)
    assert measured.high <= rate
    assert measured.low >= 0.1 * rate


@pytest.mark.parametrize("kind", ["chirp", "band_noise"])
def test_95_percent_are_heard_at_minus_6_db_and_none_in_the_wrong_place(kind):
    (point,) = detection_curve(
        Loudspeaker.of(kind, seed=3), [-6.0], shape=SHAPE, c=C, trials=1000, seed=5
    )
    assert point.heard >= math.ceil(0.95 * point.trials)
    assert point.wrong == 0
