"""A wall close behind an array, by its mirror source; and what is no wall."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry
from phonotaxis import locate
from studies.support.hearing_cases.errors_in_rooms import ARRAYS, RATE, C, recorded
from studies.support.hearing_cases.near_reflectors import before_a_wall

SQUARE = ARRAYS["square, 6.5 cm"]
CIRCLE = ARRAYS["circle of 8, 20 cm"]


def kinds(samples, places):
    geometry = ArrayGeometry.model_validate(
        {"microphones": places.tolist(), "sound_speed": C}
    )
    found = locate(samples, geometry, sample_rate_hz=RATE)
    return [fault.kind for fault in found.faults]


@pytest.mark.parametrize("places", [SQUARE, CIRCLE])
@pytest.mark.parametrize(
    ("bearing_deg", "wall_m"), [(60.0, 0.1), (85.0, 0.1), (20.0, 0.2)]
)
def test_a_wall_close_behind_is_named(places, bearing_deg, wall_m):
    assert "reflector" in kinds(before_a_wall(places, bearing_deg, wall_m), places)


@pytest.mark.parametrize("places", [SQUARE, CIRCLE])
@pytest.mark.parametrize("t60_s", [0.0, 0.4])
def test_a_room_is_no_wall(places, t60_s):
    """Nor are unequal gains."""
    samples = recorded(places, t60_s, 5, seconds=2.0).samples
    gains = np.linspace(0.8, 1.2, len(places))[:, np.newaxis]
    assert "reflector" not in kinds(gains * samples, places)
