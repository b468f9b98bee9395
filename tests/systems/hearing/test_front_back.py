"""Front or back: what the robot's motion must decide, and what it must not."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from systems.framework.signals import TICK_S
from systems.hearing.tracking.target_filter import (
    HYPOTHESIS,
    LARGEST_COST,
    LARGEST_STEP,
    SWITCH_MARGIN,
    FilterSettings,
    ages,
    blank_memory,
    chosen_track,
    fold,
)

T = TICK_S
#: Standard deviation of a measured position, m.
NOISE = 0.004
SETTINGS = FilterSettings(floor=0.005, measurement_age=0.0)
coordinate = st.floats(-5.0, 5.0)


def heard_ahead(source, pose, rng=None, *, ranged: bool = True):
    """What a row of microphones across the robot at ``pose`` makes of a source."""
    center, ahead = np.array(pose[:2]), np.array([math.cos(pose[2]), math.sin(pose[2])])
    d = np.array(source) - center
    if rng is not None:
        d = d + rng.normal(0.0, NOISE, 2)
    if ahead @ d < 0.0:
        d = d - 2.0 * (ahead @ d) * ahead
    variance = NOISE**2
    if not ranged:
        variance /= d @ d
        d = d / math.hypot(*d)
        R = variance * np.array([[d[1] ** 2, -d[0] * d[1]], [0.0, d[0] ** 2]])
    else:
        d, R = d + center, variance * np.eye(2)
    return np.array([*d, R[0, 0], R[0, 1], R[1, 1], *center, *ahead, float(ranged)])


def listen(frames: Iterable[Any], memory=None, **kwargs):
    """Memory after (source, pose) or None for silence, one a tick."""
    memory = blank_memory(2) if memory is None else memory
    for frame in frames:
        if frame is not None:
            fold(memory, heard_ahead(*frame, **kwargs), SETTINGS)
        memory += T * ages(len(memory) // HYPOTHESIS)
    return memory


def position(memory):
    return chosen_track(memory)[1:3]


def turning(source, rate: float, seconds: float):
    return [(source, (0.0, 0.0, rate * T * k)) for k in range(round(seconds / T))]


def starting(source, seconds: float, burst_s: float = 0.5):
    """A robot that accelerates along x as toward an image 2.5 m ahead."""
    frames = []
    for k in range(round(seconds / T)):
        time = k * T
        x = 0.5 * 0.66 * min(time, 1.0) ** 2 + 0.66 * max(time - 1.0, 0.0)
        frames.append((source, (x, 0.0, 0.0)) if time % 2.0 < burst_s else None)
    return frames


@given(coordinate, coordinate, st.floats(-math.pi, math.pi), st.booleans())
def test_a_source_behind_and_its_image_are_one_sighting(x, y, theta, ranged):
    """Hypothesis 1 starts where a source behind is, with its covariance."""
    source = np.array([x - 6.0 * math.cos(theta), y - 6.0 * math.sin(theta)])
    sighting = heard_ahead(source, (x, y, theta))
    sighting[2:5] = [0.04, 0.01, 0.02]
    memory = blank_memory(2)
    fold(memory, sighting, SETTINGS)
    track = memory[1 + HYPOTHESIS + 2 :]
    np.testing.assert_allclose(track[1:3], source, atol=1e-12)
    n = np.array([math.cos(theta), math.sin(theta)])
    M = np.eye(2) - 2.0 * np.outer(n, n)
    R = M @ np.array([[0.04, 0.01], [0.01, 0.02]]) @ M + SETTINGS.floor**2 * np.eye(2)
    np.testing.assert_allclose(track[5:8], [R[0, 0], R[0, 1], R[1, 1]], atol=1e-12)


@given(st.floats(165.0, 255.0))
def test_the_image_of_a_resting_source_runs_when_the_robot_turns(direction_deg):
    """A source behind throughout a turn of 60 deg in 1.5 s."""
    direction = math.radians(direction_deg)
    source = [2.0 * math.cos(direction), 2.0 * math.sin(direction)]
    memory = listen(turning(source, math.radians(40.0), 1.5))
    np.testing.assert_allclose(position(memory), source, atol=1e-3)


@pytest.mark.parametrize("ranged", [True, False])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("bearing_deg", [180.0, 150.0, -120.0])
def test_a_start_toward_the_image_tells_within_two_bursts(bearing_deg, seed, ranged):
    """Noisy frames, 0.5 s in every 2 s, while the robot drives the wrong way."""
    bearing = math.radians(bearing_deg)
    source = [2.5 * math.cos(bearing), 2.5 * math.sin(bearing)]
    rng = np.random.default_rng(seed)
    memory = listen(starting(source, 2.5), rng=rng, ranged=ranged)
    assert memory[0] == 1.0
    if ranged:
        np.testing.assert_allclose(position(memory), source, atol=5.0 * NOISE)


@pytest.mark.parametrize("seed", range(5))
def test_a_source_ahead_stays_ahead_while_the_robot_starts(seed):
    rng = np.random.default_rng(seed)
    frames = starting([4.5, 0.5], 6.0)
    memory = blank_memory(2)
    for frame in frames:
        listen([frame], memory, rng=rng)
        assert memory[0] == 0.0
    np.testing.assert_allclose(position(memory), [4.5, 0.5], atol=5.0 * NOISE)


@pytest.mark.parametrize(("side", "verdict"), [(1.0, 0.0), (-1.0, 1.0)])
def test_one_frame_of_each_burst_tells_when_the_robot_has_moved(side, verdict):
    """As in a room: the rest of a burst is lost to echoes."""
    source = [2.0 * side, 0.5]
    silence = [None] * 60
    memory = listen([(source, (0.0, 0.0, 0.0)), *silence, (source, (0.6, 0.0, 0.3))])
    assert memory[0] == verdict
    assert math.dist(position(memory), source) < 0.15


def test_nothing_is_decided_at_rest():
    """Reflection keeps all distances, however the source moves."""
    path = [([-2.0 + 0.3 * T * k, 0.5], (0.0, 0.0, 0.0)) for k in range(80)]
    memory = listen(path, rng=np.random.default_rng(1))
    assert memory[0] == 0.0
    np.testing.assert_allclose(memory[[1, 1 + HYPOTHESIS]], 0.0, atol=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_verdict_outlasts_motion_that_tells_nothing(side):
    """Decided by a turn; then both move alike for a minute of bursts."""
    source = np.array([2.0 * side, 0.3])
    memory = listen(turning(source, math.radians(40.0), 1.5))
    theta = math.radians(60.0)
    way = np.array([math.cos(theta), math.sin(theta)])
    rng = np.random.default_rng(2)
    for k in range(2400):
        p = 0.3 * T * k * way
        frame = (source + p, (*p, theta)) if k % 80 < 20 else None
        listen([frame], memory, rng=rng)
    np.testing.assert_allclose(position(memory), source + p, atol=0.6)
    assert memory[0] == float(side * math.cos(theta) < 0.0)


def test_a_source_that_passes_by_is_one_source():
    """It crosses the row's line, 1 m to the left, while the robot drives on."""
    rng = np.random.default_rng(4)
    memory = listen(turning([2.0, 1.0], -0.5, 1.0), rng=rng)
    verdicts = []
    for k in range(160):
        source = [1.0 - 0.3 * T * k, 1.0]
        listen([(source, (0.1 * T * k, 0.0, 0.1 * math.sin(k / 20)))], memory, rng=rng)
        verdicts.append(memory[0])
        if k > 20:
            assert math.dist(position(memory), source) < 0.15
    assert verdicts[0] == 0.0
    assert verdicts[-1] == 1.0


@pytest.mark.parametrize("error", [0.36, 1.0, 3.0])
def test_one_bad_frame_does_not_turn_the_verdict(error):
    """However well it may suit the image, and however sure it says it is."""
    memory = listen(turning([2.0, 0.3], 0.5, 1.0))
    assert memory[0] == 0.0
    assert memory[1 + HYPOTHESIS] > SWITCH_MARGIN + LARGEST_STEP
    before = position(memory).copy()
    pose = (0.0, 0.0, 0.5)
    listen([([2.0 + error, 0.3], pose)], memory)
    assert memory[0] == 0.0
    assert math.dist(position(memory), before) < 0.1


@given(st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=12))
def test_costs_are_bounded_and_one_hypothesis_is_free(places):
    memory = blank_memory(2)
    for place in places:
        listen([(place, (-6.0, 0.0, 0.0))], memory)
        costs = memory[[1, 1 + HYPOTHESIS]]
        assert min(costs) == 0.0
        assert max(costs) <= LARGEST_COST


def test_a_jump_may_be_one_across_the_row():
    """Sure of the front, and then heard elsewhere: both sides are open again."""
    memory = listen(turning([2.0, 0.3], 0.5, 1.5))
    assert memory[1 + HYPOTHESIS] > SWITCH_MARGIN
    jumped = [-1.0, 3.0]
    listen([(jumped, (0.0, 0.0, 0.75))] * 3, memory)
    np.testing.assert_array_equal(memory[[1, 1 + HYPOTHESIS]], 0.0)
    listen([(jumped, (0.0, 0.0, 0.75 - 0.5 * T * k)) for k in range(40)], memory)
    np.testing.assert_allclose(position(memory), jumped, atol=0.01)
