"""What a guarded robot needs ahead: between physics and the theorem's bound."""

from __future__ import annotations

import pytest

from benchmarks.guard_distances import needed_distance, passed_distance, seen_share

#: Half of the body's diagonal, m, and the braking, m/s^2.
RADIUS_M, BRAKING = 0.44578, 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "bodies"), [(0.2, 0.0), (0.72, 0.0), (0.62, 0.6)])
def test_a_run_needs_no_more_than_the_theorem(speed, bodies):
    """And no less than a point mass: the radius, v^2/2a, and the bodies' way."""
    found = passed_distance(speed, bodies)
    least = RADIUS_M + speed**2 / (2.0 * BRAKING) + bodies * speed / BRAKING
    assert least < found <= needed_distance(speed, bodies)


@pytest.mark.parametrize(
    ("preset", "degrees"),
    [("three", 90.0), ("six", 180.0), ("ring_12", 360.0), ("lidar", 360.0)],
)
def test_what_sensors_see_of_the_round(preset, degrees):
    """Cones of 30 deg side by side: three, twice three, and rings without a gap."""
    assert seen_share(preset) == pytest.approx(degrees, abs=0.6)
