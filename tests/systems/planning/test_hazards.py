"""Tracks of bodies against where the bodies are; what rests must never be one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.planning.hazards import make_hazards, pick_hazards, track_hazards
from systems.planning.looks import HazardSensors
from systems.safety.free_space import make_free_space
from systems.world.cones import fan_ranges

TICK_S, CELLS, CELL_M, AHEAD_M, FARTHEST_M = 0.025, 240, 0.05, 0.175, 3.0
AXES, HALVES = np.radians([30.0, 0.0, -30.0]), np.full(3, math.radians(15.0))
PLACES = np.zeros((3, 2))
NOWHERE = math.inf, math.inf, 0.35


def sensors(noise_m=0.001):
    return HazardSensors(
        np.full((3, 2), [AHEAD_M, 0.0]),
        np.column_stack([AXES, HALVES]),
        np.full(3, FARTHEST_M),
        np.full(3, 0.002 + 5.0 * noise_m),
        np.full(3, noise_m),
        TICK_S,
    )


def floor(*, free=True):
    """12 m x 12 m around the origin, all seen free or nothing."""
    space = make_free_space(CELLS, CELL_M, 3, 2)
    if free:
        space.free_until[:] = math.inf
    return space


def take(space, box):
    """Cells whose circles touch a box are not free: nobody can see them as a whole."""
    x, y, length, width = box
    for i in range(-CELLS // 2, CELLS // 2):
        for j in range(-CELLS // 2, CELLS // 2):
            dx = max(abs((i + 0.5) * CELL_M - x) - 0.5 * length, 0.0)
            dy = max(abs((j + 0.5) * CELL_M - y) - 0.5 * width, 0.0)
            if math.hypot(dx, dy) < CELL_M * math.sqrt(0.5):
                space.free_until[i % CELLS, j % CELLS] = -1.0


def look(
    hazards, ticks, pose_at, bodies_at, space, *, target=NOWHERE, noise_m=0.001, seed=0
):
    """Ranges of the bodies' true rectangles, tick by tick."""
    rng, known = np.random.default_rng(seed), sensors(noise_m)
    for tick in ticks:
        time = tick * TICK_S
        pose = np.array(pose_at(time))
        bodies = np.array(bodies_at(time), dtype=float).reshape(-1, 6)
        true = fan_ranges(pose, bodies, AXES, PLACES, HALVES, AHEAD_M)
        echo = (true <= FARTHEST_M).astype(float)
        ranges = np.where(echo > 0.5, true + noise_m * rng.normal(size=3), FARTHEST_M)
        readings = ranges, echo, np.zeros(3)
        track_hazards(hazards, time, pose, readings, space, target, known)


def weaving(time):
    """At rest, but for the heading."""
    return 0.0, 0.0, 0.6 * math.sin(math.tau * time / 3.0)


def crossing(time):
    """A post of 5 cm that crosses ahead at 0.36 m/s."""
    return [(2.0 - 0.1 * time, 1.2 - 0.35 * time, 0.0, 0.05, 0.05, 0.0)]


def estimate(hazards):
    """Mean place and velocity of the likeliest track."""
    best = int(np.argmax(hazards.exists))
    p = hazards.particles
    return np.array([p.x[best], p.y[best], p.vx[best], p.vy[best]]) @ p.weight[best]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise_m", [0.001, 0.01])
def test_place_and_velocity_of_a_post_that_crosses(seed, noise_m):
    hazards = make_hazards(3)
    space = floor()
    look(hazards, range(121), weaving, crossing, space, noise_m=noise_m, seed=seed)
    x, y, vx, vy = estimate(hazards)
    true = crossing(3.0)[0]
    # One body may be tracked twice where noise is as large as its movement.
    assert hazards.exists.max() > (0.9 if noise_m < 0.005 else 0.8)
    assert math.hypot(x - true[0], y - true[1]) < 0.15
    assert math.hypot(vx + 0.1, vy + 0.35) < (0.12 if noise_m < 0.005 else 0.2)


def test_echoes_from_where_nobody_has_looked_may_be_of_what_rests():
    hazards = make_hazards(3)
    look(hazards, range(121), weaving, crossing, floor(free=False))
    assert (hazards.exists == 0.0).all()


def test_nor_those_from_floor_that_is_forgotten():
    """What was seen free counts up to a rolled way: beyond it, it may be of a wall."""
    hazards, space = make_hazards(3), floor()
    space.free_until[space.free_until > 0.0] = 2.0
    space.rolled_m[0] = 2.5
    look(hazards, range(121), weaving, crossing, space)
    assert (hazards.exists == 0.0).all()
    space.rolled_m[0] = 1.5
    look(hazards, range(121), weaving, crossing, space)
    assert hazards.exists.max() > 0.9


@pytest.mark.parametrize("noise_m", [0.001, 0.01])
@pytest.mark.parametrize("turn", [0.0, 0.6, 1.5])
def test_what_rests_is_never_tracked(turn, noise_m):
    """Past a box, a post and along a wall, turning to both sides."""
    boxes = (1.5, 0.6, 0.4, 0.3), (2.2, -0.5, 0.03, 0.03), (2.0, 1.5, 4.0, 0.1)
    space, hazards = floor(), make_hazards(3)
    for box in boxes:
        take(space, box)
    bodies = [(x, y, 0.0, length, width, 0.0) for x, y, length, width in boxes]

    def pose_at(time):
        return 0.3 * time, 0.0, turn * math.sin(math.tau * time / 2.7)

    for seed in range(3):
        ticks = range(200)
        look(
            hazards, ticks, pose_at, lambda _: bodies, space, noise_m=noise_m, seed=seed
        )
        assert (hazards.exists == 0.0).all()


def test_what_is_followed_is_not_tracked():
    hazards = make_hazards(3)
    for tick in range(120):
        x, y = 1.5 + 0.3 * tick * TICK_S, 0.1
        body = [(x, y, 0.0, 0.29, 0.29, 0.0)]
        look(
            hazards,
            [tick],
            lambda _: (0.0, 0.0, 0.0),
            lambda _, body=body: body,
            floor(),
            target=(x, y, 0.35),
        )
        assert (hazards.exists == 0.0).all()


def test_a_body_that_is_no_longer_there_is_forgotten_once_looked_for():
    hazards, space = make_hazards(3), floor()
    look(hazards, range(80), weaving, crossing, space)
    assert hazards.exists.max() > 0.9
    look(hazards, range(80, 280), weaving, lambda _: [], space)
    assert hazards.exists.max() < 0.1


def test_picked_particles_stand_for_all():
    hazards, space = make_hazards(3), floor()
    look(hazards, range(80), weaving, crossing, space)
    picked = pick_hazards(hazards, 80 * TICK_S, (0.0, 0.0, 0.0), 5.0)
    weight = picked.weight
    assert weight.sum() == pytest.approx(hazards.exists.sum())
    mean = np.array([picked.x, picked.y]) @ weight / weight.sum()
    np.testing.assert_allclose(mean, estimate(hazards)[:2], atol=0.05)
    assert len(pick_hazards(hazards, 80 * TICK_S, (9.0, 9.0, 0.0), 5.0).x) == 0


def test_same_readings_same_tracks():
    pairs = []
    for _ in range(2):
        hazards = make_hazards(3)
        look(hazards, range(100), weaving, crossing, floor())
        pairs.append(hazards)
    one, other = pairs
    assert one.exists.max() > 0.9
    for a, b in zip(one.particles, other.particles, strict=True):
        assert a.tobytes() == b.tobytes()
