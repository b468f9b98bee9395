"""Tabulated laws: energies against closed forms, slopes against formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from analysis.loops.radial_law import radial_law
from systems.laws.active import active_force

K_0, RHO_0, ALPHA = 16.0, 0.8, 0.8 / (2.0 * math.log(4.0))
RANGE = 3.0


def conventional_energy(c):
    return 0.5 * K_0 * max(RHO_0 - c, 0.0) ** 2


def active_energy(c):
    """k_ref alpha (c + alpha) exp(-c/alpha), and the push d_ref mu_0 at rest."""

    def spring(x):
        return 64.0 * ALPHA * (x + ALPHA) * math.exp(-x / ALPHA)

    return spring(c) - spring(RANGE) + 0.2 * 0.6 * (RANGE - c)


def active_2017_energy(c):
    if c < 0.1:
        return 1.1 * math.log(RANGE / 0.1) + 11.0 * (0.1 - c)
    return 1.1 * math.log(RANGE / c)


def conventional_2017_energy(c):
    if c < 0.03:
        return 1.1 * math.log(RANGE / 0.03) + 1.1 / 0.03 * (0.03 - c)
    return 1.1 * math.log(RANGE / c)


@pytest.mark.parametrize(
    ("law", "energy"),
    [
        ("conventional", conventional_energy),
        ("active", active_energy),
        ("conventional2017", conventional_2017_energy),
        ("active2017", active_2017_energy),
    ],
)
def test_energy_is_the_integral_of_the_force(two_boxes, law, energy):
    table = radial_law(two_boxes(law))
    distances = np.linspace(0.0, RANGE, 301)
    expected = [energy(c) for c in distances.tolist()]
    np.testing.assert_allclose(table.energy(distances), expected, atol=5e-6)


def test_least_range_of_the_sensors_bounds_kim_s_conventional_law(two_boxes):
    """1.1 J/3 cm, and 1.1 J/5 cm: a table for each."""
    for least in (0.03, 0.05):
        setting = f"ultrasonic.minimum_range_m={least}"
        table = radial_law(two_boxes("conventional2017", setting))
        assert float(table.at_rest(0.0)) == pytest.approx(1.1 / least)


@given(st.floats(1e-3, 2.999))
def test_force_between_entries(c):
    from diagrams import load_scenario

    scenario = load_scenario("default", ["law=active"])
    table = radial_law(scenario)
    expected = active_force(c, 0.0, scenario.follower.laws.active)
    assert float(table.at_rest(c)) == pytest.approx(expected, abs=1e-4)


def test_nothing_is_felt_beyond_the_range(two_boxes):
    table = radial_law(two_boxes("active"))
    assert table.force(RANGE + 1e-6) == 0.0
    assert float(table.at_rest(RANGE + 1e-6)) == 0.0
    assert float(table.energy(RANGE + 1.0)) == 0.0


def test_slopes_at_rest(two_boxes):
    """df/dc and df/ds of both laws by hand."""
    conventional = radial_law(two_boxes("conventional"))
    assert conventional.gradient(0.5, 0.0) == pytest.approx((-K_0, 0.8))
    assert conventional.gradient(0.9, 0.3) == (0.0, 0.0)
    active = radial_law(two_boxes("active"))
    beta = 0.6 / (2.0 * math.log(4.0))
    expected = (
        64.0 * math.exp(-0.5 / ALPHA) * (1.0 - 0.5 / ALPHA),
        0.2 * (0.6 / beta - 1),
    )
    assert active.gradient(0.5, 0.0) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("law", "place", "stiffness"),
    [
        ("active", 2.0 * ALPHA, 64.0 / math.e**2),
        ("conventional2017", 0.03, 1.1 / 0.03**2),
        ("active2017", 0.1, 1.1 / 0.1**2),
    ],
)
def test_stiffest_point_is_that_of_the_formula(two_boxes, law, place, stiffness):
    distance, found = radial_law(two_boxes(law)).stiffest
    assert distance == pytest.approx(place, abs=2e-3)
    assert found == pytest.approx(stiffness, rel=1e-6)


def test_increments_are_those_of_the_velocity_term(two_boxes):
    table = radial_law(two_boxes("conventional")).increments_n
    np.testing.assert_allclose(table[250, :51], 0.8 * 0.01 * np.arange(51), atol=1e-12)
    assert np.all(table[401:] == 0.0)


def test_a_block_without_a_radial_law_is_refused(two_boxes, tmp_path, monkeypatch):
    (tmp_path / "own_blocks.py").write_text(
        "from pydrake.systems.framework import LeafSystem\n\n\n"
        "class Block(LeafSystem):\n"
        "    def __init__(self, robot, attraction, laws):\n"
        "        super().__init__()\n"
        "        for name, size in (\n"
        "            ('acceleration_W', 2), ('forces_W', 4), ('obstacle_speeds', 3)\n"
        "        ):\n"
        "            calc = lambda context, output: None\n"
        "            self.DeclareVectorOutputPort(name, size, calc)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match="write it as a function law"):
        radial_law(two_boxes("active", "law=own_blocks:Block"))


def test_a_force_that_is_not_finite_is_refused(two_boxes, tmp_path, monkeypatch):
    (tmp_path / "own_laws.py").write_text(
        "def no_number(c, s, laws):\n    return float('nan')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    scenario = two_boxes("active", "law=own_laws:no_number")
    with pytest.raises(ValueError, match=r"law: .* returns nan"):
        radial_law(scenario)
