"""Ranges of arrays that are not known well, beside brute force and beside truth."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_budget import ArrayBudget
from analysis.arrays.range_posterior import range_posterior
from systems.sound.array_shape import ArrayShape

C = 340.0
ROW = ArrayShape.of([[0.0, 0.4], [0.0, 0.0], [0.0, -0.4]])
PLANE = ArrayShape.of([[0.5, 0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0], [0.5, -0.5, 0]])
CIRCLE = ArrayShape.of(
    [[np.cos(a), np.sin(a), 0.1 * (-1) ** k] for k, a in enumerate(np.arange(8) / 1.3)]
)


def delays(p_AM, p_AS, c=C):
    arrivals = np.linalg.norm(p_AM - p_AS, axis=1) / c
    return arrivals[1:] - arrivals[0]


def test_row_as_by_a_sum_over_a_fine_grid_of_places():
    """Uniform over ranges and bearings, with the likelihood of each place.

    Ranges outside of the grid are less likely by 1e-6 and more.
    """
    budget = ArrayBudget(0.002**2 * np.eye(ROW.p_AM.size), 2.0, 1e-6)
    own = 1e-12 * (np.eye(2) + 1.0)
    angle = np.radians(25.0)
    u = np.array([np.cos(angle), np.sin(angle)])
    tau = delays(ROW.p_AM, 2.0 * u)
    ranges = np.linspace(1.0, 4.5, 300)
    bearings = angle + np.linspace(-0.05, 0.05, 81)
    mass = np.zeros((ranges.size, bearings.size))
    for j, bearing in enumerate(bearings):
        d = np.array([np.cos(bearing), np.sin(bearing)])
        for i, r in enumerate(ranges):
            whole = own + budget.delay_covariance(d, 1.0 / r, ROW, C)
            off = tau - delays(ROW.p_AM, r * d)
            power = -0.5 * off @ np.linalg.solve(whole, off)
            mass[i, j] = np.exp(power) / np.sqrt(np.linalg.det(whole / own[0, 0]))
    of_range = mass.sum(axis=1)
    mean = np.average(ranges, weights=of_range)
    std = np.sqrt(np.average((ranges - mean) ** 2, weights=of_range))
    found = range_posterior(
        tau, own, ROW, budget, C, start=(u, 0.5, 0.05), nearest_m=0.2
    )
    assert found.range == pytest.approx(mean, rel=0.01)
    assert found.range_std == pytest.approx(std, rel=0.03)


@pytest.mark.parametrize(
    ("shape", "position_std"), [(ROW, 0.002), (PLANE, 0.005), (CIRCLE, 0.02)]
)
def test_two_of_three_ranges_are_within_what_is_stated(shape, position_std):
    rng = np.random.default_rng(4)
    budget = ArrayBudget(position_std**2 * np.eye(shape.p_AM.size), 0.01 * C, 0.0)
    own = (5e-7) ** 2 * (np.eye(shape.count - 1) + 1.0)
    off = []
    for _ in range(300):
        u = rng.standard_normal(shape.dimension)
        u[0] = abs(u[0]) + 0.5
        if shape.dimension == 3:
            u[2] = abs(u[2]) + 0.2
        u /= np.linalg.norm(u)
        r = rng.uniform(0.8, 3.0)
        places = shape.p_AM + position_std * rng.standard_normal(shape.p_AM.shape)
        tau = delays(places, r * u, C * (1.0 + 0.01 * rng.standard_normal()))
        found = range_posterior(
            tau, own, shape, budget, C, start=(u, 1.0 / r, 0.1 / r), nearest_m=0.2
        )
        if found.range_std < 0.2 * found.range:
            off.append(abs(found.range - r) / found.range_std)
    assert len(off) > 60
    # Of 60 or more draws, 68 and 95 % within three deviations.
    assert 0.55 < np.mean(np.array(off) < 1.0) < 0.84
    assert np.mean(np.array(off) < 2.0) > 0.87
