"""The sum-of-squares region: its model, its proof, and what would break it."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver
from scipy.linalg import expm

from studies.proofs.lag_model import lag_model
from studies.proofs.sos_program import feasibility, is_proved, solve
from studies.proofs.sos_region import sos_region

pytestmark = pytest.mark.drake


@pytest.fixture(scope="module")
def region(two_boxes):
    return sos_region(two_boxes("active"), starts=300)


@pytest.mark.slow
def test_region_is_proved_and_no_start_touches(region):
    assert region.certified
    assert region.exact
    assert region.collisions == 0
    assert 0.0 < region.region_share < region.safe_share <= 1.0


@pytest.mark.slow
def test_region_lies_in_the_domain(region):
    x, v, w = region.extent()
    low, high = region.model.domain_m
    assert x <= min(-low, high)
    assert v <= 0.72
    assert w > 0.0
    assert region.model.contact.equilibrium_m - x > region.contact_m


@pytest.mark.slow
def test_v_falls_along_the_law_itself(region):
    """At random points of the region, by the table and not by the polynomial."""
    rng = np.random.default_rng(6)
    model = region.model
    scenario, law = model.contact.scenario, model.contact.law
    y = rng.standard_normal((2000, 3))
    y *= 0.999 / np.sqrt(np.einsum("ni,ij,nj->n", y, region.P, y))[:, None]
    y *= rng.uniform(0.05, 1.0, (2000, 1))
    x, v, w = (y * model.scales).T
    c = model.contact.equilibrium_m + x
    force = law.at_rest(c) - 2.0 * (model.contact.to_go_m + c)
    rates = np.column_stack(
        [w, (force - v) / 3.94, (v - w) / scenario.only.plant.motor_lag_s]
    )
    dot = 2.0 * np.einsum("ni,ij,nj->n", y, region.P, rates / model.scales)
    assert dot.max() < 0.0


@pytest.mark.slow
def test_a_region_that_is_too_large_is_not_proved(region):
    """Blown up past the domain, and so far that V rises somewhere."""
    model = region.model
    for factor in (0.9, 0.05):
        P = factor * region.P
        problem = feasibility(model, P)
        assert not is_proved(
            model, P, problem, solve(ClarabelSolver(), problem.program)
        )
    assert not is_proved(model, region.P, feasibility(model, region.P), None)


@pytest.mark.parametrize("law", ["conventional", "active", "active2017"])
def test_polynomial_stays_within_its_error_of_the_law(two_boxes, law):
    model = lag_model(two_boxes(law))
    x = np.linspace(*model.domain_m, 20_001)[1:-1]
    x = x[np.abs(x) > 1e-3]
    c = model.contact.equilibrium_m + x
    force = np.array([model.contact.force(value) for value in c.tolist()])
    y = x / model.scales[0]
    h = np.polynomial.polynomial.polyval(y, model.coefficients)
    assert np.abs(-force / x - h).max() <= model.error_n_m + 0.01
    assert model.error_n_m <= 0.01 * model.coefficients[0]


def test_simulation_of_the_conventional_law_is_linear(two_boxes):
    """Inside of the reach: against the matrix exponential, by who touches."""
    model = lag_model(two_boxes("conventional"))
    A = np.array(
        [[0.0, 0.0, 1.0], [-18.0 / 3.94, -1.0 / 3.94, 0.0], [0.0, 20.0, -20.0]]
    )
    starts = np.array([[0.0, -0.5, -0.5], [-0.3, -0.65, -0.65], [-0.4, -0.7, -0.7]])
    rest = model.contact.equilibrium_m
    motion = [
        np.array([expm(A * t) @ y for t in np.arange(0.0, 0.8, 0.005)]) for y in starts
    ]
    expected = [bool((rest + m[:, 0]).min() <= 0.03) for m in motion]
    found = model.simulate(starts, contact_m=0.03, duration_s=0.8)
    assert found.tolist() == expected
    assert any(expected)
    assert not all(expected)


def test_an_unstable_contact_has_no_region(two_boxes):
    stiff = ("laws.conventional.stiffness_n_m=30", "plant.motor_lag_s=0.1")
    with pytest.raises(
        ValueError, match=r"no region of attraction .* 0.1 s of motor lag"
    ):
        sos_region(two_boxes("conventional", *stiff))
