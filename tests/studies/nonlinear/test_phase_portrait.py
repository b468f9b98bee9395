"""The head-on plane: certified starts against energy by hand, and simulation."""

from __future__ import annotations

import numpy as np
import pytest

from studies.nonlinear.head_on import head_on
from studies.nonlinear.phase_portrait import (
    certified_speeds,
    head_on_model,
    phase_portrait,
)

LAWS = ("conventional", "active", "active2017")


@pytest.mark.parametrize("law", LAWS)
def test_no_certified_start_touches(two_boxes, law):
    portrait = phase_portrait(two_boxes(law), points=21)
    assert not np.any(portrait.certified & portrait.collides)
    assert portrait.collides.any()
    assert 0.0 < portrait.ratio <= 1.0


def test_certified_speed_is_that_of_the_energy(two_boxes):
    """From rest speed v at c inside of the reach: M v^2/2 = W(r_c) - W(c)."""
    contact = head_on(two_boxes("conventional"), to_go_m=1.7)
    model = head_on_model(contact)
    c = np.array([0.2, 0.3])

    def level(x):
        return 8.0 * (0.8 - x) ** 2 + (1.7 + x) ** 2

    expected = np.sqrt(2.0 * (level(0.03) - level(c)) / 3.94)
    found = certified_speeds(model, c, 0.03)
    clamp = 0.72
    np.testing.assert_allclose(found, np.minimum(expected, clamp), atol=4e-3)


def test_beyond_what_the_top_speed_passes_all_is_certified(two_boxes):
    contact = head_on(two_boxes("conventional"), to_go_m=1.7)
    found = certified_speeds(head_on_model(contact), np.array([1.0, 1.5]), 0.03)
    assert np.all(found > 0.72)


def test_inside_the_active_laws_inner_equilibrium_rest_is_not_certified(two_boxes):
    contact = head_on(two_boxes("active"), to_go_m=1.7)
    inner = contact.equilibria_m[1]
    found = certified_speeds(head_on_model(contact), np.array([inner - 0.02]), 0.03)
    assert np.isnan(found[0])


def test_model_is_the_head_on_law(two_boxes):
    contact = head_on(two_boxes("active"), to_go_m=1.7)
    model = head_on_model(contact)
    for c in (0.1, 0.4, 0.9, 2.0):
        force = model.force(np.array([[-c, 0.0, 0.0, 0.0]]), "none")[0]
        assert force == pytest.approx([-contact.force(c), 0.0], abs=1e-4)
