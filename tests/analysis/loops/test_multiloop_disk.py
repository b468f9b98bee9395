"""Disk margins of several loops, against published values and closed forms."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import loop_margins
from analysis.loops.multiloop_disk import mu_lower, mu_upper, multiloop_disk_margin


def model_of(A, B, C, D, period_s=None) -> LinearModel:
    A, B, C, D = (np.atleast_2d(np.asarray(m, dtype=float)) for m in (A, B, C, D))
    names = (
        tuple(f"x{k}" for k in range(len(A))),
        tuple(f"u{k}" for k in range(B.shape[1])),
        tuple(f"y{k}" for k in range(len(C))),
    )
    return LinearModel("L", A, B, C, D, *names, period_s)


def test_spinning_satellite():
    # MathWorks, "Stability margins of a spinning satellite": each loop alone has the
    # disk margin 2. For all loops at the output of the plant, ``diskmargin`` gives a
    # lower bound of 0.0997 and an upper bound of 0.0998.
    a = 10.0
    satellite = model_of(
        [[0, a], [-a, 0]], np.eye(2), [[1, a], [-a, 1]], np.zeros((2, 2))
    )
    found = multiloop_disk_margin(satellite)
    assert 0.0997 <= found.alpha <= 0.0998
    assert found.destabilizing_alpha == pytest.approx(found.alpha, rel=1e-6)


def test_one_loop_is_the_loop_of_the_margins():
    plant = control.ss(control.tf([25.0], [1.0, 10.0, 10.0, 10.0]))
    model = model_of(plant.A, plant.B, plant.C, plant.D)
    for disk in loop_margins(model).disks:
        found = multiloop_disk_margin(model, disk.skew)
        assert found.alpha == pytest.approx(disk.alpha, rel=1e-7)
        assert found.frequency_rad_s == pytest.approx(disk.frequency_rad_s, rel=1e-3)


@pytest.mark.parametrize("period_s", [None, 0.1])
def test_loops_apart_have_the_least_of_their_margins(period_s):
    both = model_of(
        np.diag([-1.0, -0.2]), np.diag([3.0, 0.5]), np.eye(2), np.zeros((2, 2))
    )
    if period_s:
        sampled = control.ss(both.A, both.B, both.C, both.D).sample(period_s)
        both = model_of(sampled.A, sampled.B, sampled.C, sampled.D, period_s)
    single = [
        loop_margins(both.part([f"u{k}"], [f"y{k}"])).disk.alpha for k in range(2)
    ]
    assert multiloop_disk_margin(both).alpha == pytest.approx(min(single), rel=1e-6)


def test_bounds_meet_for_up_to_three_loops_and_hold_for_more():
    rng = np.random.default_rng(4)
    for n in (2, 2, 3, 3, 5):
        M = rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n))
        low, high = mu_lower(M), mu_upper(M)
        assert low <= high * (1.0 + 1e-9)
        if n <= 3:
            assert low == pytest.approx(high, rel=1e-5)
        # mu lies between the spectral radius and the largest singular value.
        assert low >= np.abs(np.linalg.eigvals(M)).max() * (1.0 - 1e-9)
        assert high <= np.linalg.norm(M, 2) * (1.0 + 1e-9)


def test_mu_of_rank_one_is_known():
    rng = np.random.default_rng(5)
    u, v = rng.normal(size=(2, 4)) + 1j * rng.normal(size=(2, 4))
    # For M = u v^H, mu is the sum of |u_i v_i|.
    M = np.outer(u, v.conj())
    expected = float((np.abs(u) * np.abs(v)).sum())
    assert mu_upper(M) == pytest.approx(expected, rel=1e-6)
    assert mu_lower(M) == pytest.approx(expected, rel=1e-6)


def test_a_loop_that_is_unstable_has_no_margin():
    unstable = model_of([[1.0]], [[1.0]], [[0.5]], [[0.0]])
    found = multiloop_disk_margin(unstable)
    assert found.alpha == 0.0
    assert math.isnan(found.frequency_rad_s)
