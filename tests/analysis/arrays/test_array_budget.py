"""What errors of an array do to delays, beside drawn arrays and another prediction."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.sensitivity import ArrayErrors, predicted_std
from systems.hearing.multilateration import locate_source
from systems.sound.array_shape import ArrayShape

C = 340.0
FIVE = ArrayShape.of(
    [[0.2, 0.3, 0], [0.3, -0.1, 0], [-0.1, -0.3, 0.1], [-0.3, 0.1, 0], [0, 0.05, 0.2]]
)


@pytest.mark.parametrize("distance", [0.8, 3.0, np.inf])
def test_delays_of_drawn_arrays_scatter_by_the_budget(distance):
    rng = np.random.default_rng(3)
    u = np.array([0.48, -0.6, 0.64])
    mixed = 1e-3 * rng.standard_normal((15, 15))
    budget = ArrayBudget(mixed @ mixed.T, 2.0, 3e-6)
    draws = 20_000
    places = FIVE.p_AM + (rng.standard_normal((draws, 15)) @ mixed.T).reshape(-1, 5, 3)
    if np.isfinite(distance):
        paths = np.linalg.norm(distance * u - places, axis=2)
    else:
        paths = -places @ u
    arrivals = paths / (C + 2.0 * rng.standard_normal((draws, 1)))
    arrivals += 3e-6 * rng.standard_normal(arrivals.shape)
    measured = np.cov((arrivals[:, 1:] - arrivals[:, :1]).T)
    stated = budget.delay_covariance(u, 1.0 / distance, FIVE, C)
    # Of 20 000 draws a covariance is known to about 1 %.
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    np.testing.assert_allclose(measured / scale, stated / scale, atol=0.03)


@pytest.mark.parametrize("bearing", [0.0, 0.6, 1.0])
def test_places_are_as_uncertain_as_the_table_of_sensitivities_says(bearing):
    row = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
    p_AS = 2.0 * np.array([np.cos(bearing), np.sin(bearing)])
    expected = predicted_std(
        ArrayErrors(position_m=1e-4, delay_s=1e-7, sound_speed_share=1e-3), p_AS, row, C
    )
    budget = ArrayBudget(1e-8 * np.eye(row.p_AM.size), 1e-3 * C, 1e-7)
    ranges = np.linalg.norm(p_AS - row.p_AM, axis=1)
    covariance = budget.delay_covariance(p_AS / 2.0, 0.5, row, C)
    fix = locate_source((ranges[1:] - ranges[0]) / C, covariance, row, C)
    assert fix.range_std == pytest.approx(expected.range, rel=1e-3)
    assert fix.bearing_std == pytest.approx(expected.bearing, rel=1e-3)
