"""The grid holds a place for every source; the response is greatest there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.arrays.steered_response import (
    SearchGrid,
    centroid_delays,
    steered_response,
)
from systems.hearing.source_fix import NEAREST_M
from systems.sound.array_shape import ArrayShape

C = 340.0
HIGH = 4_000.0
ARRAYS: dict[str, list[list[float]]] = {
    "row": [[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]],
    "unequal row": [[0.0, 0.0], [0.05, 0.0], [0.15, 0.0], [0.35, 0.0]],
    "square": [[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]],
    "level square": [[0.1, 0.1, 1], [-0.1, 0.1, 1], [-0.1, -0.1, 1], [0.1, -0.1, 1]],
    "upright square": [[0.1, 0, 0.1], [0, 0, 0.1], [0, 0, 0], [0.1, 0, 0]],
    "tetrahedron": [[0.1, 0.1, 0.1], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]],
    "large": [[0, 0, 0], [1.2, 0, 0.1], [1.1, 1, 0.5], [0.1, 0.9, 1], [0.6, 0.4, 1.3]],
}
SHAPES = {name: ArrayShape.of(places) for name, places in ARRAYS.items()}
GRIDS = {name: SearchGrid.of(shape, C, HIGH, 0.032) for name, shape in SHAPES.items()}


@st.composite
def sources(draw):
    """An array, and a source at the side of it that is looked at."""
    name = draw(st.sampled_from(sorted(ARRAYS)))
    shape = SHAPES[name]
    axes = shape.span if shape.ahead is None else np.vstack((shape.span, shape.ahead))
    v = np.array([draw(st.floats(-1.0, 1.0)) for _ in axes])
    v[0] += 1.5 if v[0] >= 0.0 else -1.5  # no zero vector
    if shape.ahead is not None:
        v[-1] = abs(v[-1])
    u = v / np.linalg.norm(v) @ axes
    distance = draw(st.floats(NEAREST_M + 0.05, 20.0))
    return name, u, distance


@given(sources())
def test_every_source_has_a_place_with_nearly_its_delays(source):
    name, u, distance = source
    shape, grid = SHAPES[name], GRIDS[name]
    rate = grid.lag_rate_hz
    for place, inverse in ((u, 0.0), (u * distance, 1.0 / distance)):
        later = centroid_delays(place[np.newaxis], np.array([inverse]), shape, C)[0]
        first, second = shape.pairs.T
        lags = rate * (later[second] - later[first]) + grid.max_lag
        off = np.abs(grid.lags - lags).max(axis=1).min()
        # A quarter of the shortest period, where the grid is no coarser.
        assert off <= 0.25 * grid.coarseness * rate / HIGH


@pytest.mark.parametrize("name", sorted(ARRAYS))
def test_delays_of_places_near_and_far(name):
    """From the distances themselves; 1 km is far away."""
    shape = SHAPES[name]
    u = np.ones(shape.dimension) / np.sqrt(shape.dimension)
    for distance in (0.7, 1e3):
        p = distance * u
        expected = np.linalg.norm(p - shape.p_AM, axis=1) - distance
        near = centroid_delays(p[np.newaxis], np.array([1 / distance]), shape, C)[0]
        np.testing.assert_allclose(near, expected / C, atol=1e-12)
    far = centroid_delays(u[np.newaxis], np.zeros(1), shape, C)[0]
    np.testing.assert_allclose(far, expected / C, atol=1e-3 / C)


@pytest.mark.parametrize("name", sorted(ARRAYS))
def test_response_is_greatest_at_the_source(name):
    """Correlations that are cosines under a bell, as of band noise."""
    shape, grid = SHAPES[name], GRIDS[name]
    place = len(grid.lags) // 3
    columns = np.arange(2 * grid.max_lag + 1)
    off = (columns - grid.lags[place][:, np.newaxis]) * HIGH / grid.lag_rate_hz
    correlations = np.cos(2 * np.pi * 0.6 * off) * np.exp(-((1.5 * off) ** 2))
    response = steered_response(correlations.astype(np.float32), grid)
    assert response.max() == pytest.approx(1.0)
    best = grid.lags[response.argmax()] - grid.lags[place]
    assert np.abs(best).max() <= grid.blur.max()
    assert shape.pairs.shape[0] == grid.lags.shape[1]


def test_only_the_side_that_is_looked_at():
    for name, shape in SHAPES.items():
        if shape.ahead is not None:
            assert (GRIDS[name].p_AS @ shape.ahead).min() >= 0.0


def test_sources_above_a_plane_given_by_x_and_y():
    lengths = np.linalg.norm(GRIDS["square"].p_AS, axis=1)
    assert lengths.min() < 0.1


def test_large_arrays_get_a_coarser_grid():
    assert GRIDS["square"].coarseness == 1.0
    assert GRIDS["large"].coarseness > 1.0
    assert GRIDS["large"].lags.size < 2_000_000


@pytest.mark.parametrize(("count", "dimension"), [(48, 2), (35, 3), (64, 2), (64, 3)])
def test_many_microphones_have_a_grid_of_4_deg(count, dimension):
    """It is no finer than that, and no direction is farther from it."""
    rng = np.random.default_rng(count)
    shape = ArrayShape.of(rng.uniform(-0.15, 0.15, (count, dimension)))
    grid = SearchGrid.of(shape, C, HIGH, 0.032)
    far = grid.p_AS[grid.inverse_range == 0.0]
    far = far[np.linalg.norm(far, axis=1) > 1.0 - 1e-9]
    # A sphere is covered by caps of 4 deg at 4 pi / 0.0698^2 = 2579 points.
    assert len(far) <= (2_600 if dimension == 3 else 180)
    assert len(grid.lags) < 1.5 * 3_900
    assert len(np.unique(np.round(far, 6), axis=0)) == len(far), "each once"
    for _ in range(50):
        u = rng.standard_normal(dimension)
        u /= np.linalg.norm(u)
        assert np.degrees(np.arccos((far @ u).max())) < 4.0
