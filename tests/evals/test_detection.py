"""Ten minutes of noise, and sounds below it: what is heard, and what is not."""

from __future__ import annotations

import math

import pytest
from scipy.stats import binomtest

from analysis.arrays.single_frames import Loudspeaker
from studies.support.detection import FalseAlarms, detection_curve, false_alarms
from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

pytestmark = pytest.mark.slow

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
RATES = (1e-1, 1e-2, 1e-3)
FRAMES = round(600.0 / TICK_S)


@pytest.fixture(scope="module")
def alarms() -> dict[float, FalseAlarms]:
    """In ten minutes of noise, by the rate that is set, see docs/results_hearing.md."""
    found = false_alarms(
        (*RATES, TDOAParameters().false_alarm_rate), FRAMES, shape=SHAPE, c=C, seed=9
    )
    return {alarm.rate: alarm for alarm in found}


def test_nothing_is_heard_in_ten_minutes_of_noise(alarms):
    default = alarms[TDOAParameters().false_alarm_rate]
    assert (default.frames, default.count) == (24_000, 0)


@pytest.mark.parametrize("rate", RATES)
def test_false_alarms_are_no_more_than_set_and_no_tenth_of_it(alarms, rate):
    """By the 95 % interval of what was counted."""
    measured = binomtest(alarms[rate].count, FRAMES).proportion_ci(0.95)
    assert measured.high <= rate
    assert measured.high >= 0.1 * rate


@pytest.mark.parametrize("kind", ["chirp", "band_noise"])
def test_95_percent_are_heard_at_minus_6_db_and_none_in_the_wrong_place(kind):
    (point,) = detection_curve(
        Loudspeaker.of(kind, seed=3), [-6.0], shape=SHAPE, c=C, trials=1000, seed=5
    )
    assert point.heard >= math.ceil(0.95 * point.trials)
    assert point.wrong == 0
