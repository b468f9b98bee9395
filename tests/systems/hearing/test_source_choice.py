"""Two sounds at once: both are placed, and the followed source's is chosen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from systems.base.robot import RobotParameters
from systems.delays.delay_sets import estimate_delay_sets
from systems.delays.delays import look
from systems.delays.half_band import halve_rate
from systems.hearing.parameters import TDOAParameters
from systems.hearing.source_choice import Belief
from systems.hearing.tdoa_estimator import (
    TDOAEstimator,
    robot_choice,
    robot_localizer,
)
from systems.hearing.tracking.target_filter import NEVER_HEARD_S
from systems.sound.acoustics import SOUND_SPEED_M_S
from systems.sound.adc import convert
from systems.sound.parameters import MicArrayParameters

FS, N, C, FRAME_S = 100_000.0, 2500, 340.0, 0.025
ROBOT = RobotParameters()
MICROPHONES = np.array(ROBOT.microphones_m)
#: Of P in B: the middle microphone.
AHEAD = np.array([ROBOT.control_point_m, 0.0])
CHOSEN, OTHER = np.array([1.7, -0.8]), np.array([1.2, 1.5])
AT_REST = np.zeros(3)


def band_noise(seed):
    """Spectrum of a second of noise of 0.5-8 kHz, and its frequencies."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.standard_normal(round(FS)))
    hertz = np.fft.rfftfreq(round(FS), 1.0 / FS)
    spectrum[(hertz < 500.0) | (hertz > 8_000.0)] = 0.0
    return spectrum, hertz


def arriving(place, seed, frame):
    """(3, N) of noise from a place, of RMS 1 at 1 m of it."""
    spectrum, hertz = band_noise(seed)
    rows = []
    for r in np.linalg.norm(place - MICROPHONES, axis=1):
        later = spectrum * np.exp(-2j * np.pi * hertz * r / C)
        wave = np.fft.irfft(later) / (r * np.std(np.fft.irfft(spectrum)))
        rows.append(wave[10_000 + frame * N :][:N])
    return np.array(rows)


def heard(frame=0, *, levels=(1.0, 1.0), chosen=CHOSEN, other=OTHER):
    """(3, N) counts of both at once, each of a pressure at P, in some noise."""
    pressure = 0.02 * sum(
        level * np.linalg.norm(place) * arriving(place, seed, frame)
        for seed, (place, level) in enumerate(
            zip((chosen, other), levels, strict=True), start=1
        )
    )
    noise = np.random.default_rng(frame).standard_normal((3, N)).astype(np.float32)
    return convert(pressure.astype(np.float32), noise, 1e-4, MicArrayParameters())


def delays_from(place):
    ranges = np.linalg.norm(place - MICROPHONES, axis=1)
    return (ranges[1:] - ranges[0]) / C


def believed(p_PS, std=0.3, age=1.5, pose=AT_REST):
    """A source at a place from P, seen from where the robot stands at first."""
    return Belief(p_PS + AHEAD, std**2 * np.eye(2), age, np.asarray(pose))


class Ear:
    """Localizer and choice of the default robot, with their memories."""

    def __init__(self, first_bearing_deg=None):
        parameters = TDOAParameters(
            choose="followed", first_bearing_deg=first_bearing_deg
        )
        self.localizer, p_PA = robot_localizer(parameters, ROBOT, SOUND_SPEED_M_S)
        self.choice = robot_choice(self.localizer, ROBOT, p_PA, FRAME_S)
        self.hearing, self.memory = self.localizer.blank(), self.choice.blank()

    def listen(self, counts, belief, **options):
        found, self.hearing = self.localizer.candidates(counts, self.hearing)
        best, self.memory = self.choice.choose(found, self.memory, belief, **options)
        return None if best is None else found[best].fix


def off(fix, place):
    """Standard deviations by which a fix misses a place."""
    assert fix is not None
    assert fix.range_valid
    miss = fix.p_AS - place
    return math.sqrt(miss @ np.linalg.solve(fix.covariance, miss))


NOTHING_YET = Belief(np.zeros(2), np.zeros((2, 2)), NEVER_HEARD_S, AT_REST)


@pytest.mark.parametrize("level", [0.5, 1.0, 2.0])
def test_each_sound_has_its_delays(level):
    """Of both within five of their stated deviations; 6 dB below, chance hides some."""
    plan, found = Ear().localizer.plan, []
    for frame in range(5):
        counts = halve_rate(heard(frame, levels=(1.0, level)))
        seen = look(counts, plan)
        assert seen is not None
        sets = estimate_delay_sets(counts, plan, "gcc", seen, 3)
        for place in (CHOSEN, OTHER):
            miss = [np.abs(s.tau - delays_from(place)).max() for s in sets]
            nearest = sets[int(np.argmin(miss))]
            stated = math.sqrt(np.diag(nearest.covariance).max())
            found.append(min(miss) < 5.0 * stated + 0.2e-6 and stated < 4e-5)
    assert sum(found) >= (10 if level == 1.0 else 9)


@pytest.mark.parametrize("level", [0.5, 1.0, 2.0])
@pytest.mark.parametrize(("followed", "not_it"), [(CHOSEN, OTHER), (OTHER, CHOSEN)])
def test_the_followed_source_is_placed(followed, not_it, level):
    """Whichever it is, and however loud: from what the tracker says of it alone."""
    ear, misses = Ear(), []
    for frame in range(8):
        near = believed(followed + np.array([0.1, -0.1]), 0.2, 0.2)
        fix = ear.listen(heard(frame, levels=(1.0, level)), near)
        if fix is not None:
            misses.append(off(fix, followed))
            assert np.linalg.norm(fix.p_AS - not_it) > 0.5
    assert len(misses) >= 5
    # Of two dimensions, 1 in 1000 is beyond 3.7.
    assert np.median(misses) < 2.5
    assert max(misses) < 6.0


def test_without_it_nothing_is_heard():
    """The other source goes on, and is expected where it is."""
    ear = Ear()
    for frame in range(4):
        ear.listen(heard(frame), believed(CHOSEN, 0.05, 0.03))
    for frame in range(4, 20):
        age = 0.03 + (frame - 3) * FRAME_S
        belief = believed(CHOSEN, 0.05 + 0.35 * age, age)
        assert ear.listen(heard(frame, levels=(0.0, 1.0)), belief) is None


def test_a_source_nearby_is_not_jumped_to():
    """A wide gate holds the other one, too; but that one is known."""
    ear = Ear()
    near = CHOSEN + np.array([0.0, 0.7])
    for frame in range(4):
        ear.listen(heard(frame, other=near), believed(CHOSEN, 0.05, 0.03))
    for frame in range(4, 10):
        belief = believed(CHOSEN, 0.6, 1.5)
        fix = ear.listen(heard(frame, levels=(0.0, 1.0), other=near), belief)
        assert fix is None


def test_a_source_behind_is_one_ahead_until_the_robot_has_turned():
    """A row hears no difference; the line of the last time tells both places."""
    ear = Ear()
    behind = CHOSEN * (-1.0, 1.0)
    assert off(ear.listen(heard(0, levels=(1.0, 0.1)), believed(CHOSEN)), CHOSEN) < 6.0
    # In truth it was behind: the robot turns left by 30 deg, and still may hear it.
    turn = math.radians(30.0)
    rotation = np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    )
    p_PS = rotation.T @ (behind + AHEAD) - AHEAD
    belief = believed(CHOSEN, 0.1, 0.5, (0.0, 0.0, turn))
    fix = ear.listen(heard(1, levels=(1.0, 0.1), chosen=p_PS), belief)
    assert off(fix, np.abs(p_PS) * (1.0, np.sign(p_PS[1]))) < 6.0


def test_the_first_time_a_bearing_tells():
    degrees = math.degrees(math.atan2(*CHOSEN[::-1]))
    assert off(Ear(degrees + 5.0).listen(heard(), NOTHING_YET), CHOSEN) < 6.0
    assert Ear(-degrees - 25.0).listen(heard(), NOTHING_YET) is None
    # Without one it is what sounds alone.
    assert Ear().listen(heard(), NOTHING_YET) is None
    alone = heard(levels=(1.0, 0.0))
    assert off(Ear().listen(alone, NOTHING_YET), CHOSEN) < 6.0


def test_a_schedule_excludes_it():
    ear = Ear()
    assert ear.listen(heard(), believed(CHOSEN), may_sound=False) is None
    assert ear.listen(heard(1), believed(CHOSEN)) is not None


def test_ports_of_what_is_believed():
    """They act on the state alone: nothing passes straight through."""
    block = TDOAEstimator(parameters=TDOAParameters(choose="followed"))
    names = [block.get_input_port(k).get_name() for k in range(block.num_input_ports())]
    belief = ["p_WS_estimated", "covariance_W", "age", "pose_WB_estimated"]
    assert names == ["audio", *belief]
    assert not block.HasAnyDirectFeedthrough()
    assert TDOAEstimator().num_input_ports() == 1


def test_a_first_bearing_without_a_choice_is_refused():
    with pytest.raises(ValidationError, match="first_bearing_deg"):
        TDOAParameters(first_bearing_deg=10.0)
