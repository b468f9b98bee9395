"""Ranges of fans of sensors, sensor by sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.world.cones import cone_range, fan_ranges

CONTROL_POINT_M = 0.1
EVEN = np.radians(np.arange(72) * 5.0)


def directions(kind, rng):
    return {
        "circle": EVEN,
        "clockwise": EVEN[::-1].copy(),
        "front": np.radians(np.linspace(135.0, -135.0, 30)),
        "uneven": np.sort(rng.uniform(-4.0, 9.0, 12)),
        "unordered": rng.uniform(-4.0, 9.0, 6),
    }[kind]


def bodies(rng):
    """Boxes, segments, discs and points with and without radii, one at the robot."""
    count = rng.integers(1, 12)
    rows = np.zeros((count, 6))
    rows[:, :2] = rng.uniform(-4.0, 4.0, (count, 2))
    rows[:, 2] = rng.uniform(-7.0, 7.0, count)
    rows[:, 3:5] = rng.uniform(0.0, 2.0, (count, 2)) * (rng.random((count, 2)) < 0.7)
    rows[:, 5] = rng.uniform(0.0, 0.5, count) * (rng.random(count) < 0.5)
    rows[0, :2] *= 0.05
    return rows


@pytest.mark.parametrize(
    "kind", ["circle", "clockwise", "front", "uneven", "unordered"]
)
@pytest.mark.parametrize("reach_m", [math.inf, 3.0])
def test_a_fan_measures_what_its_sensors_measure_alone(kind, reach_m):
    """To the last bit, up to the reach."""
    rng = np.random.default_rng(3)
    hits = 0
    for half_angle in np.repeat([1e-4, 0.04, 0.5, 1.5], 30):
        axes, rows = directions(kind, rng), bodies(rng)
        halves = np.full(len(axes), half_angle)
        places = np.tile(rng.uniform(-0.3, 0.3, 2), (len(axes), 1))
        x, y, theta = rng.uniform(-2.0, 2.0, 3) * [1.0, 1.0, 4.0]
        c, s = math.cos(theta), math.sin(theta)
        alone = np.empty(len(axes))
        for k, (x_PS, left) in enumerate(places):
            ahead = CONTROL_POINT_M + x_PS
            at = x + c * ahead - s * left, y + s * ahead + c * left
            alone[k] = cone_range(*at, theta + axes[k], half_angle, rows)
        pose = np.array([x, y, theta])
        found = fan_ranges(pose, rows, axes, places, halves, CONTROL_POINT_M, reach_m)
        near = alone <= reach_m
        np.testing.assert_array_equal(found[near], alone[near])
        assert (found[~near] > reach_m).all()
        hits += int(np.count_nonzero(np.isfinite(alone) & (alone > 0.0)))
    assert hits > 200
