"""Arrays of some of the microphones are these microphones."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.recordings.array_geometry import ArrayGeometry
from analysis.recordings.array_match import chosen_microphones
from systems.framework.input_error import InputError

PLACES = ((0.1, 0.0), (0.0, 0.1), (-0.1, 0.0), (0.0, -0.2))


def test_each_keeps_its_place_channel_and_deviation():
    all_of_them = ArrayGeometry(
        microphones=PLACES,
        channels=(5, 2, 7, 1),
        position_std_m=(0.001, 0.002, 0.003, 0.004),
        temperature_c=20.0,
    )
    three = chosen_microphones(all_of_them, (0, 2, 3))
    assert three.microphones == (PLACES[0], PLACES[2], PLACES[3])
    assert three.columns == (5, 7, 1)
    assert three.position_std_m == (0.001, 0.003, 0.004)
    assert three.c == all_of_them.c


def test_covariances_of_all_keep_their_rows():
    rng = np.random.default_rng(1)
    root = 1e-3 * rng.standard_normal((8, 8))
    matrix = root @ root.T
    rows = tuple(map(tuple, matrix.tolist()))
    geometry = ArrayGeometry(microphones=PLACES, position_covariance_m2=rows)
    kept = chosen_microphones(geometry, (1, 2, 3)).known.budget.of_places
    np.testing.assert_allclose(kept, matrix[2:, 2:])


def test_two_are_too_few():
    with pytest.raises((InputError, ValueError), match="microphones"):
        chosen_microphones(ArrayGeometry(microphones=PLACES), (0, 1))
