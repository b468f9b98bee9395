"""Bounds for a moving source and obstacle, against worst cases and simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from analysis.loops.point_mass import point_mass
from studies.proofs.disturbance_bounds import (
    _certified_time,
    _peak_gain,
    disturbance_bounds,
    encounter_contact_time,
    source_bound,
)


@pytest.fixture(scope="module")
def bounds(two_boxes):
    return disturbance_bounds(two_boxes("conventional"), runs=20)


def test_proved_bound_holds_what_is_simulated_and_the_linear_worst_case(bounds):
    straight = [row for row in bounds.source if row.acceleration_m_s2 == 0.0]
    assert len(straight) == 6
    for row in straight:
        assert row.steady_m == pytest.approx(row.speed_m_s / 2.0)
        assert row.steady_m < row.simulated_m < row.linear_peak_m < row.bound_m


def test_peak_gain_is_the_integral_of_the_impulse_response(two_boxes):
    model = point_mass(two_boxes("conventional"))
    decay = 1.0 / (2.0 * 3.94)
    omega = math.sqrt(2.0 / 3.94 - decay**2)

    def response(t):
        return abs(math.exp(-decay * t) * math.sin(omega * t)) / (3.94 * omega)

    half = math.pi / omega
    total = sum(quad(response, k * half, (k + 1) * half)[0] for k in range(60))
    assert _peak_gain(model) == pytest.approx(total, rel=1e-8)


def test_bound_holds_for_a_source_in_the_plane(two_boxes):
    """A source on a circle: |v_S| and |a_S| constant; integrated independently."""
    scenario = two_boxes("conventional")
    model = point_mass(scenario)
    speed, radius = 0.2, 1.0
    bound = source_bound(model, speed, speed**2 / radius, simulate=False).bound_m
    h, p, v = 0.005, np.array([1.0 - 1.2, 0.0]), np.array([0.0, speed])
    largest = 0.0
    for k in range(round(80.0 / h)):
        angle = speed / radius * k * h
        p_S = radius * np.array([math.cos(angle), math.sin(angle)])
        e = p - p_S
        r = float(np.linalg.norm(e))
        largest = max(largest, abs(r - 1.2))
        v = v + h * (-2.0 * (1.0 - 1.2 / r) * e - v) / 3.94
        v = v * min(1.0, 0.72 / np.linalg.norm(v))
        p = p + h * v
    assert bound is not None
    assert largest < bound


@pytest.mark.parametrize(
    ("law", "weak", "certified"),
    [
        ("conventional", ["conventional.stiffness_n_m=1"], 3),
        (
            "active",
            ["active.reference_stiffness_n_m=4", "active.matched_stiffness_n_m=1"],
            5,
        ),
        ("active2017", ["active2017.distance_gain_j=0.1"], 4),
    ],
)
def test_no_simulated_contact_before_its_certified_time(
    two_boxes, law, weak, certified
):
    """Laws so weak that bodies of all six speeds reach P, though not at once."""
    scenario = two_boxes(law, *(f"laws.{field}" for field in weak))
    rows = disturbance_bounds(scenario, runs=20).obstacle
    assert len(rows) == 6
    assert sum(row.certified_s > 0.0 for row in rows) == certified
    for row in rows:
        assert row.simulated_contact_s is not None
        assert row.simulated_contact_s > row.certified_s


def test_certified_time_against_the_differential_inequality(two_boxes):
    """Integrated by Euler's method from the same energy."""
    model = point_mass(two_boxes("conventional"))
    speed, spare = 0.3, 0.2
    V, t, h = 0.5 * 3.94 * speed**2, 0.0, 1e-4
    V += 0.01 * float(model.law.energy(0.0))  # what is left of U at its reach
    barrier = float(model.law.energy(0.03))
    while barrier > V:
        V += h * (math.sqrt(4.0 * V) * speed + speed**2 / (4.0 * spare))
        t += h
    assert _certified_time(model, speed, spare, 0.03) == pytest.approx(t, rel=0.02)


def test_without_a_law_an_obstacle_reaches_a_waiting_robot(two_boxes):
    model = point_mass(two_boxes("none"))
    times = encounter_contact_time(model, 0.3, 0.03, np.array([0.0, 0.5]), 0.8, 5.0)
    assert times[0] == pytest.approx(0.77 / 0.3, abs=0.03)
    assert np.isinf(times[1])


def test_a_velocity_term_that_takes_all_of_d_r_leaves_no_bound(two_boxes):
    strong = "laws.conventional.damping_n_s_m=1.0"
    assert disturbance_bounds(two_boxes("conventional", strong), runs=2).obstacle == ()
