"""Pole clouds and sensitivities, against loops with closed forms."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping

import numpy as np
import pytest

from analysis.loops.linear_models import damping_ratio
from analysis.loops.linear_plots import plot_pole_cloud, plot_sensitivities
from analysis.loops.robustness import (
    UncertainParameter,
    pole_cloud,
    pole_sensitivities,
    slowest_pole,
)

T = 0.025


def oscillator(values: Mapping[str, float]) -> np.ndarray:
    """Poles exp(s T) of M s^2 + D s + K = 0."""
    s = np.roots([values["M"], values["D"], values["K"]])
    return np.exp(s.astype(complex) * T)


def parameter(name: str, nominal: float, share: float) -> UncertainParameter:
    low, high = sorted((nominal * (1.0 - share), nominal * (1.0 + share)))
    return UncertainParameter(name, name, "", nominal, low, high, "a test")


BOX = (
    parameter("M", 3.94, 0.2), parameter("D", 1.0, 0.5), parameter("K", 2.0, 0.1)
)  # fmt: skip


def test_sensitivities_are_the_closed_form() -> None:
    # From M s^2 + D s + K = 0: ds/dK = -1/(2 M s + D), ds/dD = s ds/dK, ...
    s = slow = complex(-1.0, math.sqrt(4 * 2.0 * 3.94 - 1.0)) / (2 * 3.94)
    by_K = -1.0 / (2.0 * 3.94 * s + 1.0)
    expected = {"K": by_K, "D": s * by_K, "M": s * s * by_K}
    rows = pole_sensitivities(oscillator, BOX, period=T)
    for row in rows:
        assert row.pole == pytest.approx(slow, rel=1e-12)
        assert row.derivative == pytest.approx(expected[row.parameter.name], rel=1e-5)
        width = row.parameter.high - row.parameter.low
        assert row.per_interval == pytest.approx(row.derivative * width, rel=1e-12)


def test_worst_corner_is_the_heaviest_and_least_damped() -> None:
    # The decay rate is D / (2 M), whatever K is.
    cloud = pole_cloud(oscillator, BOX, period=T, samples=50, seed=3)
    assert cloud.worst_values["D"] == 0.5
    assert cloud.worst_values["M"] == pytest.approx(1.2 * 3.94)
    assert cloud.worst_growth_per_s == pytest.approx(-0.5 / (2 * 1.2 * 3.94))
    assert cloud.worst_radius >= cloud.radii.max() > cloud.nominal_radius
    assert cloud.stable_share == 1.0


def test_samples_fill_the_box_and_follow_the_seed() -> None:
    cloud = pole_cloud(oscillator, BOX, period=T, samples=40, seed=3)
    for k, p in enumerate(BOX):
        # A Latin hypercube has one point in each of 40 slices of each side.
        slices = np.floor((cloud.values[:, k] - p.low) / (p.high - p.low) * 40)
        assert sorted(slices) == list(range(40))
    again = pole_cloud(oscillator, BOX, period=T, samples=40, seed=3)
    other = pole_cloud(oscillator, BOX, period=T, samples=40, seed=4)
    assert (again.values == cloud.values).all()
    assert not (other.values == cloud.values).all()


def test_unstable_corner_is_found_where_few_samples_are_unstable() -> None:
    # D - K/40 < 0 only in one far corner of the box.
    def coupled(values: Mapping[str, float]) -> np.ndarray:
        damping = values["D"] - values["K"] / 4.2
        return oscillator({"M": 1.0, "D": damping, "K": values["K"]})

    cloud = pole_cloud(coupled, BOX, period=T, samples=20, seed=1)
    assert cloud.worst_radius > 1.0
    assert cloud.worst_values["D"] == 0.5
    assert cloud.worst_values["K"] == pytest.approx(2.2)
    assert cloud.worst_damping_ratio < 0.0


def test_damping_ratio_of_a_discrete_pole() -> None:
    s = 2.0 * cmath.exp(1j * (math.pi - math.acos(0.3)))
    pole = cmath.exp(s * T)
    slowest = slowest_pole(np.array([pole.conjugate(), 0.1]), T)
    assert slowest == pytest.approx(s)
    assert damping_ratio(slowest) == pytest.approx(0.3)


@pytest.mark.parametrize("interval", [(2.0, 3.0), (0.0, 0.5), (1.0, 1.0)])
def test_bad_interval_is_refused(interval: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"mass: .*correct the interval"):
        UncertainParameter("mass", "M", "kg", 1.0, *interval, "a test")


def test_pictures_show_every_sample_and_parameter() -> None:
    cloud = pole_cloud(oscillator, BOX, period=T, samples=30, seed=1)
    axes = plot_pole_cloud(cloud).axes[0]
    by_label = {line.get_label(): line for line in axes.lines}
    assert np.size(by_label["random values"].get_xdata()) == 60
    assert np.size(by_label["worst case"].get_xdata()) == 2
    rows = pole_sensitivities(oscillator, BOX, period=T)
    bars = plot_sensitivities(rows).axes[0].patches
    assert len(bars) == 3
