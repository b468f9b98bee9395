"""What a guarded robot needs ahead: between physics and the theorem's bound."""

from __future__ import annotations

import numpy as np
import pytest

from studies.guard_distances import (
    BODIES_M_S,
    SPEEDS_M_S,
    draw_chart,
    needed_distance,
    passed_distance,
)
from systems.ranging.sensor_presets import SENSOR_PRESETS

#: Half of the body's diagonal, m, and the braking, m/s^2.
RADIUS_M, BRAKING = 0.44578, 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "bodies"), [(0.2, 0.0), (0.72, 0.0), (0.62, 0.6)])
def test_a_run_needs_no_more_than_the_theorem(speed, bodies):
    """And no less than a point mass: the radius, v^2/2a, and the bodies' way."""
    found = passed_distance(speed, bodies)
    least = RADIUS_M + speed**2 / (2.0 * BRAKING) + bodies * speed / BRAKING
    assert least < found <= needed_distance(speed, bodies)


def test_the_chart_shows_all_speeds_and_presets():
    passed = {(v, u): 1.0 + v + u for v in SPEEDS_M_S for u in BODIES_M_S}
    distances, views = draw_chart(passed).axes
    for u, dots in zip(BODIES_M_S, distances.get_lines()[1::2], strict=True):
        assert np.asarray(dots.get_ydata()).tolist() == [
            passed[v, u] for v in SPEEDS_M_S
        ]
    bold = [text.get_text() for text in views.texts if text.get_fontweight() == "bold"]
    assert bold == [*SENSOR_PRESETS]
