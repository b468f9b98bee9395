"""Which cells count as occupied, and how far off the nearest is."""

from __future__ import annotations

import numpy as np
import pytest

from systems.laws.baselines.baseline_controller import split_at_disc
from systems.planning.occupied import list_occupied
from systems.safety.free_space import make_free_space

CELL_M = 0.05


def floor(*hits):
    """Cells (i, j) with how often they echoed."""
    space = make_free_space(200, CELL_M, 1, 2)
    for i, j, count in hits:
        space.hits[i % 200, j % 200] = count
    return space


def test_cells_that_echoed_and_how_certain_they_are():
    space = floor((10, 4, 3.0), (-7, 2, 60.0), (5, 5, 0.9))
    found = list_occupied(space, 0.0, 0.0, 2.0)
    np.testing.assert_allclose(
        sorted(found.tolist()), [[-0.325, 0.125, 1.0], [0.525, 0.225, 0.5]]
    )


def test_only_within_reach_and_not_of_what_is_followed():
    space = floor((10, 4, 3.0), (30, 0, 3.0))
    assert len(list_occupied(space, 0.0, 0.0, 1.0)) == 1
    assert len(list_occupied(space, 1.0, 0.0, 1.0)) == 2
    others, followed = split_at_disc(
        list_occupied(space, 0.0, 0.0, 9.0), (1.4, 0.2), 0.3
    )
    assert len(others) == len(followed) == 1
    assert len(list_occupied(space, 50.0, 0.0, 2.0)) == 0


def test_any_number_of_cells():
    space = floor(*((i, j, 2.0) for i in range(-15, 15) for j in range(-15, 15)))
    found = list_occupied(space, 0.0, 0.0, 2.0)
    assert len(found) == 900
    assert found[:, :2].mean() == pytest.approx(0.0)
