"""Readings and poses that cannot be, and those that can."""

from __future__ import annotations

import math
from itertools import count

import numpy as np
import pytest

from systems.framework.block import copied
from systems.ranging.parameters import UltrasonicParameters
from systems.safety.sensing_monitor import SENSING_FAULTS, SensingMonitor

T = 0.025
#: Top speed and distance of the wheels (Han 2019, table 5).
TOP_M_S, AXLE_M = 0.72, 0.41


class Watched:
    """A monitor that is told what is read, tick by tick."""

    def __init__(self, **sensors):
        block = SensingMonitor(sensors=UltrasonicParameters.model_validate(sensors))
        self.step, self.ticks = block.step, count()
        self.state = copied(block.step.state)

    def tells(self, ranges, pose=(0.0, 0.0, 0.0), echo=(1, 1, 1), ages=(0.0, 0.0, 0.0)):
        """Name of what is wrong, and the sensor."""
        out = [[0.0, 0.0]]
        inputs = pose, ranges, echo, ages
        self.step.step(next(self.ticks), self.state, inputs, out, self.step.numbers)
        return SENSING_FAULTS[int(out[0][0])], out[0][1]


def sound_ranges(draw, where=(1.0, 1.5, 2.0), noise_m=0.001):
    return np.array(where) + noise_m * draw.standard_normal(3)


def test_a_pose_that_jumps_is_lost_for_good():
    """Twice what the wheels can in a tick, ahead and turning about one wheel."""
    draw, way = np.random.default_rng(1), 2.0 * TOP_M_S * T
    for step, lost in ((0.99 * way, False), (1.01 * way, True)):
        watched = Watched()
        for k in range(3):
            told = watched.tells(sound_ranges(draw), (3.0 + k * step, 1.0, 2.0))
        assert told == (("odometry lost", 0) if lost else ("none", 0))
        told = watched.tells(sound_ranges(draw), (3.0 + 2 * step, 1.0, 2.0))
        assert (told[0] == "odometry lost") == lost
    spin = 2.0 * 2.0 * TOP_M_S / AXLE_M * T
    for turn, lost in ((0.99 * spin, False), (1.01 * spin, True)):
        watched = Watched()
        for k in range(2):
            told = watched.tells(sound_ranges(draw), (0.0, 0.0, k * turn))
        assert (told[0] == "odometry lost") == lost


@pytest.mark.parametrize(
    ("period_s", "firing", "silent_s"),
    [
        (0.025, "simultaneous", 0.2),
        (0.1, "simultaneous", 0.3),
        (T, "sequential", 0.225),
    ],
)
def test_who_fires_no_more_is_silent(period_s, firing, silent_s):
    """After three rounds and 0.2 s; 2 s after it fires again, all is well."""
    watched = Watched(period_s=period_s, firing=firing)
    draw = np.random.default_rng(2)
    ages = np.array([0.0, silent_s - 1e-6, 0.0])
    assert watched.tells(sound_ranges(draw), ages=ages) == ("none", 0)
    ages[1] = silent_s + 0.001
    assert watched.tells(sound_ranges(draw), ages=ages) == ("silent", 2)
    told = [watched.tells(sound_ranges(draw))[0] for _ in range(100)]
    assert told.index("none") == pytest.approx(2.0 / T, abs=1)


def test_equal_echoes_of_a_sensor_with_noise_are_frozen():
    watched, draw = Watched(), np.random.default_rng(3)
    told = []
    for _ in range(14):
        ranges = sound_ranges(draw)
        ranges[2] = 1.234
        told.append(watched.tells(ranges))
    # The first and twelve that are like it.
    assert told.index(("frozen", 3)) == 12


def test_without_noise_echoes_stay_equal_along_a_wall_but_not_in_a_turn():
    along, turning = Watched(noise_m=0.0), Watched(noise_m=0.0)
    ranges = (1.0, 1.5, 2.0)
    for k in range(400):
        assert along.tells(ranges, (0.01 * k, 0.0, 0.3)) == ("none", 0)
    heading, told = 0.0, ("none", 0.0)
    while told[0] == "none":
        heading += 0.01
        told = turning.tells(ranges, (0.0, 0.0, heading))
    assert told == ("frozen", 1)
    # An aperture of 30 deg, and 0.1 rad.
    assert heading == pytest.approx(math.radians(30.0) + 0.1, abs=0.03)


def test_the_least_and_the_greatest_range_may_stay():
    """Whoever touches the robot, or is as far as it sees."""
    watched = Watched()
    for _ in range(100):
        assert watched.tells((0.03, 3.0, 0.03)) == ("none", 0)


def test_ranges_that_jump_about_are_noise():
    watched, draw, told = Watched(), np.random.default_rng(4), []
    for _ in range(40):
        ranges = sound_ranges(draw)
        ranges[0] += 0.3 * draw.standard_normal()
        told.append(watched.tells(ranges))
    assert 6 <= told.index(("noisy", 1)) <= 12
    assert {sensor for _, sensor in told} == {0, 1}


@pytest.mark.parametrize("noise_m", [0.0, 0.001, 0.01])
def test_stated_noise_and_bodies_that_come_and_go_are_none(noise_m):
    """Ten minutes; every 0.5 s another body, at up to 2 m/s to or fro."""
    watched, draw = Watched(noise_m=noise_m), np.random.default_rng(5)
    where, rates = np.ones(3), np.zeros(3)
    for k in range(24_000):
        if k % 20 == 0:
            where, rates = draw.uniform(0.5, 2.5, 3), draw.uniform(-2.0, 2.0, 3)
        where = np.clip(where + T * rates, 0.1, 2.9)
        # Nothing is read twice but by chance: the robot weaves.
        ranges = sound_ranges(draw, where, max(noise_m, 1e-6))
        echo = draw.random(3) > 0.1
        assert watched.tells(ranges, echo=echo) == ("none", 0)


def test_bodies_that_enter_and_leave_a_narrow_beam_are_no_noise():
    """Ten minutes among posts: every look but the second has a step of up to 3 m."""
    watched, draw = Watched(noise_m=0.01), np.random.default_rng(7)
    where = np.ones(3)
    for k in range(24_000):
        if k % 2 == 0:
            where = draw.uniform(0.1, 2.9, 3)
        assert watched.tells(sound_ranges(draw, where, 0.01)) == ("none", 0)


def test_in_a_fast_turn_ranges_may_jump():
    """Along fences: edges of apertures run over posts."""
    watched, draw = Watched(), np.random.default_rng(6)
    for k in range(200):
        ranges = draw.uniform(0.5, 2.5, 3)
        assert watched.tells(ranges, (0.0, 0.0, 0.02 * k)) == ("none", 0)
