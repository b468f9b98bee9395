"""False alarms and the detection curve: what is counted, and as what."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from analysis.arrays.single_frames import Loudspeaker
from studies.support import detection
from studies.support.detection import detection_curve, false_alarms
from systems.base.robot import RobotParameters
from systems.delays.delays import look
from systems.delays.half_band import halve_rate
from systems.framework.noise import tick_generator
from systems.hearing.localize import Localizer
from systems.hearing.parameters import TDOAParameters
from systems.sound.array_shape import ArrayShape

C = 340.0
SHAPE = ArrayShape.of(RobotParameters().microphones_m)
CHIRP = Loudspeaker.of("chirp", seed=3)


def curve(levels_db, trials=12, **changes):
    settings = {"shape": SHAPE, "c": C, "trials": trials, "seed": 2, **changes}
    return detection_curve(CHIRP, levels_db, **settings)


def test_false_alarms_are_counted_at_every_rate_by_itself():
    """They belong to the seed, and grow with the rate."""
    rates = (0.999, 0.3, 1e-9)
    alarms = false_alarms(rates, 200, shape=SHAPE, c=C, seed=9)
    assert [alarm.rate for alarm in alarms] == list(rates)
    assert alarms[1:2] == false_alarms([0.3], 200, shape=SHAPE, c=C, seed=9)
    most, some, none = (alarm.count for alarm in alarms)
    # Of the frames that are louder than the noise, hardly one is left at 0.999.
    assert most > 40
    assert 0 < some < 0.3 * 200
    assert none == 0


def test_a_chance_is_a_false_alarm_of_every_rate_above_it():
    """Something is heard in a first frame if and only if its rate is higher."""
    noise = tick_generator(9, 3).standard_normal((3, 2500), dtype=np.float32)
    default = Localizer(TDOAParameters(), SHAPE, C)
    seen = look(halve_rate(noise), default.plan)
    assert seen is not None
    for factor, heard in ((1.01, True), (0.99, False)):
        rate = factor * seen[0].chance
        localizer = Localizer(TDOAParameters(false_alarm_rate=rate), SHAPE, C)
        _, memory = localizer.localize(noise, localizer.blank())
        # What is noise leaves its level behind.
        assert (memory.energy == 0.0) == heard


def test_loud_is_heard_and_faint_is_not():
    loud, faint = curve([20.0, -40.0])
    assert (loud.snr_db, loud.trials) == (20.0, 12)
    assert (loud.heard, loud.ranged, loud.wrong) == (12, 12, 0)
    assert (faint.heard, faint.ranged, faint.wrong) == (0, 0, 0)


def test_what_is_off_by_more_than_it_says_is_wrong(monkeypatch):
    """An estimator that takes sound for 15 % faster: sin(bearing) is 1.15 times it."""

    def mistaken(parameters, shape, c):
        return Localizer(parameters, shape, 1.15 * c)

    monkeypatch.setattr(detection, "Localizer", mistaken)
    (point,) = curve([20.0], 25, range_m=20.0)
    bearings = [
        abs(tick_generator(2, trial).uniform(-math.pi / 3.0, math.pi / 3.0))
        for trial in range(25)
    ]
    errors = [math.asin(1.15 * math.sin(bearing)) - bearing for bearing in bearings]
    limit = math.radians(5.0)
    assert sum(error > 1.1 * limit for error in errors) <= point.wrong
    assert point.wrong <= sum(error > 0.9 * limit for error in errors)
    assert 0 < point.wrong < point.heard


#: What a made-up estimator is off by, and states, deg; then: is that wrong?
ANSWERS = [
    (4.9, 0.1, False),
    (-5.1, 0.1, True),
    (5.1, 1.01, True),
    (-5.1, 1.03, False),
    (9.0, 2.0, False),
]


def test_frames_of_a_made_up_estimator_are_counted(monkeypatch):
    """Of six trials it hears five, two of them with a range; noise came before."""
    heard, fixes = [], []
    for trial, (off, std, _) in enumerate(ANSWERS):
        bearing = tick_generator(2, trial).uniform(-math.pi / 3.0, math.pi / 3.0)
        fix = {"bearing": bearing + math.radians(off), "bearing_std": math.radians(std)}
        fixes.append(SimpleNamespace(**fix, range_valid=trial in (1, 4)))

    class MadeUp:
        plan = SimpleNamespace(shape=SHAPE)

        def __init__(self, *_):
            self.answers = iter([None] * 8 + [*fixes, None])

        def blank(self):
            return None

        def localize(self, frame, _):
            heard.append(frame)
            return next(self.answers), None

    monkeypatch.setattr(detection, "Localizer", MadeUp)
    (point,) = curve([20.0], 6, range_m=4.0)
    assert (point.heard, point.ranged) == (5, 2)
    assert point.wrong == sum(wrong for *_, wrong in ANSWERS)
    noise = np.array(heard[:8]).reshape(8, -1)
    np.testing.assert_allclose(noise.std(axis=1), CHIRP.level_pa / 40.0, rtol=0.05)
    assert np.abs(np.corrcoef(noise) - np.eye(8)).max() < 0.1, "noise of its own each"


def test_a_stricter_rate_hears_less():
    levels = [-12.0, -10.0]
    lax, strict = (
        curve(levels, trials=25, parameters=TDOAParameters(false_alarm_rate=rate))
        for rate in (1e-3, 1e-12)
    )
    for a, b in zip(lax, strict, strict=True):
        assert b.heard < a.heard
