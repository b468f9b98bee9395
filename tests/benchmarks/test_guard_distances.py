"""What a guarded robot needs ahead: between physics and the theorem's bound."""

from __future__ import annotations

import pytest

from benchmarks.guard_distances import needed_distance, passed_distance

#: Half of the body's diagonal, m, and the braking, m/s^2.
RADIUS_M, BRAKING = 0.44578, 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "bodies"), [(0.2, 0.0), (0.72, 0.0), (0.62, 0.6)])
def test_a_run_needs_no_more_than_the_theorem(speed, bodies):
    """And no less than a point mass: the radius, v^2/2a, and the bodies' way."""
    found = passed_distance(speed, bodies)
    least = RADIUS_M + speed**2 / (2.0 * BRAKING) + bodies * speed / BRAKING
    assert least < found <= needed_distance(speed, bodies)
