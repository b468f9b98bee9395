"""Choices against what a simulation of robot and body of its own says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from systems.planning.evasion import (
    choose_motion,
    find_threats,
    risk_of,
    watch_of,
)
from systems.planning.hazards import Sample

HALF_SIZE = 0.175, 0.41
HERE = 0.0, 0.0, 0.0


def body(x, y, vx, vy, *, age=0.0, spread=0.0):
    """One body, whose place and velocity are known."""
    return Sample(*np.array([[x], [y], [vx], [vy], [1.0], [age], [spread]]))


def choice(bodies, wanted=(0.45, 0.0, 0.0), held=0.0):
    return choose_motion(bodies, HERE, wanted, held, HALF_SIZE)


def clearance(bodies, speed, heading, seconds=3.0):
    """Least distance of the body's sides from the particle, in small steps."""
    x, y, theta, least, step = 0.0, 0.0, 0.0, math.inf, 0.005
    for k in range(round(seconds / step)):
        error = (heading - theta + math.pi) % math.tau - math.pi
        theta += step * min(max(3.0 * error, -2.0), 2.0)
        x += step * speed * math.cos(theta)
        y += step * speed * math.sin(theta)
        for px, py, vx, vy in zip(*bodies[:4], strict=True):
            dx = px + (k + 1) * step * vx - x
            dy = py + (k + 1) * step * vy - y
            u = abs(math.cos(theta) * dx + math.sin(theta) * dy) - HALF_SIZE[0]
            w = abs(-math.sin(theta) * dx + math.cos(theta) * dy) - HALF_SIZE[1]
            least = min(least, math.hypot(max(u, 0.0), max(w, 0.0)))
    return least


@pytest.mark.parametrize(
    ("x", "y", "vx", "vy"),
    [
        (2.0, 0.0, -0.4, 0.0),  # head-on
        (1.2, 1.2, 0.0, -0.4),  # from the left, at a constant bearing
        (1.0, -1.4, 0.1, -0.45 + 0.9),  # from the right
        (0.0, 1.5, 0.45, -0.4),  # from abeam
    ],
)
def test_what_would_be_hit_is_evaded(x, y, vx, vy):
    bodies = body(x, y, vx, vy, age=0.3)
    assert clearance(bodies, 0.45, 0.0) < 0.05
    speed, heading, watched = choice(bodies)
    assert watched > 0.05
    assert clearance(bodies, speed, heading) > 0.15


def test_beside_a_body_only_getting_away_counts():
    """A guard stops a robot that turns beside a body, which then comes up to it."""
    behind = body(-0.65, 0.1, 0.35, 0.0)
    assert risk_of(behind, HERE, 0.6, 0.0, HALF_SIZE) < 0.2
    turning = risk_of(behind, HERE, 0.6, 2.0, HALF_SIZE)
    assert turning > 0.5
    # Far from it the same turn leads away.
    far = body(-1.6, 0.1, 0.35, 0.0)
    assert risk_of(far, HERE, 0.6, 2.0, HALF_SIZE) < 0.2


def test_risk_counts_bodies_that_are_hit():
    ahead = body(0.9, 0.0, 0.0, 0.0)
    assert risk_of(ahead, HERE, 0.45, 0.0, HALF_SIZE) == pytest.approx(0.9, abs=0.1)
    beside = body(0.9, 0.41 + 0.5, 0.0, 0.0)
    assert risk_of(beside, HERE, 0.45, 0.0, HALF_SIZE) == 0.0
    between = body(0.9, 0.41 + 0.29, 0.0, 0.0)  # half of the way from 15 to 43 cm
    assert risk_of(between, HERE, 0.45, 0.0, HALF_SIZE) == pytest.approx(0.45, abs=0.1)


@pytest.mark.parametrize(
    ("x", "y", "vx", "vy"), [(2.0, 1.0, 0.3, 0.4), (-2.5, 0.0, -0.3, 0.0)]
)
def test_what_goes_away_changes_nothing(x, y, vx, vy):
    speed, heading, _ = choice(body(x, y, vx, vy), (0.45, 0.0, 0.2))
    assert (speed, heading) == (0.45, 0.2)


def test_what_was_lost_from_view_is_looked_at():
    """A body abeam that may come: fresh, it is left to itself; stale, it is not."""
    lost = body(0.2, 1.3, 0.0, -0.1, age=2.0)
    _, heading, _ = choice(lost)
    bearing = math.atan2(1.3, 0.2)
    assert 0.3 < heading < bearing
    threats = find_threats(lost, HERE, (0.45, 0.0))
    assert threats.bearing_rad == pytest.approx([bearing])
    assert watch_of(threats, heading) < 0.5 * watch_of(threats, 0.0)


def test_where_the_guard_holds_it_does_not_try_again():
    bodies = body(2.0, 0.0, -0.4, 0.0, age=0.3)
    speed, heading, _ = choice(bodies, held=0.45)
    assert speed <= 0.0 or abs(heading) >= 0.6
