"""The certified set: levels against independent minima, and what follows."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import EnergyCertificate, certify_energy
from diagrams.scenario.scenario import Scenario
from systems.world.geometry import rectangle_corners

LAWS = ("conventional", "active", "active2017")


@pytest.fixture(scope="module")
def certificates(two_boxes):
    return {law: certify_energy(two_boxes(law), cell_m=0.02) for law in LAWS}


def least_energy_on_a_ring(model, rectangle, contact):
    """Least potential at the contact distance round a rectangle, by golden section."""
    corners = rectangle_corners(rectangle)
    normals = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    best = math.inf
    for k in range(4):
        a, b = corners[k] + contact * normals[k], corners[k - 3] + contact * normals[k]

        def along(t, a=a, b=b):
            return float(model.potential([a + t * (b - a)])[0])

        first = math.atan2(*normals[k][::-1])

        def round_(t, k=k, first=first):
            direction = np.array([math.cos(first - t), math.sin(first - t)])
            return float(model.potential([corners[k] + contact * direction])[0])

        for path, end in ((along, 1.0), (round_, math.pi / 2)):
            found = minimize_scalar(path, bounds=(0.0, end), method="bounded")
            best = min(best, found.fun, path(0.0), path(end))
    return best


@pytest.mark.parametrize("law", LAWS)
def test_contact_energy_is_just_below_the_least_at_contact(certificates, law):
    """Never above, for then it would certify too much; and not far below."""
    certificate = certificates[law]
    model = certificate.model
    for k, rectangle in enumerate(model.rectangles):
        least = least_energy_on_a_ring(model, rectangle, certificate.contact_m)
        found = certificate.escape_j[k][certificate.free].min()
        assert found <= least + 1e-9
        # Within a cell the source's distance varies by a diagonal at most.
        slope = model.stiffness_n_m * 3.5
        assert found >= least - slope * math.sqrt(2.0) * certificate.cell_m


@pytest.mark.parametrize("law", LAWS)
def test_potential_of_a_cell_is_above_that_of_its_points(certificates, law):
    certificate = certificates[law]
    rng = np.random.default_rng(1)
    i = rng.integers(0, len(certificate.x_m), 3000)
    j = rng.integers(0, len(certificate.y_m), 3000)
    offset = rng.uniform(-0.5, 0.5, (3000, 2)) * certificate.cell_m
    points = np.column_stack([certificate.x_m[i], certificate.y_m[j]]) + offset
    assert np.all(certificate.model.potential(points) <= certificate.potential_j[i, j])


@pytest.mark.parametrize("law", LAWS)
def test_no_certified_start_collides_and_some_other_does(certificates, law):
    trials = try_certificate(certificates[law], starts=150)
    assert len(trials.inside.starts) == 150
    assert trials.inside_collisions == 0
    assert trials.outside_collisions > 0
    assert trials.inside.energy_rises_j.max() < 1e-3
    assert 0.0 < trials.energy_share <= trials.certified_share
    assert trials.ratio <= 1.0


def made(**fields: Any) -> Any:
    """Stands in for what the levels do not depend on."""
    return SimpleNamespace(**fields)


def test_speeds_and_shares_of_made_up_levels():
    """2 kg, 1.5 m/s at most: v^2 = E - W of the worse body; five free cells, one not.

    Spare are 4 J (2 m/s: the top), 0.25 J, and of the rest 0.25 J of one body, the
    other being safe at any speed, less than none, and less than none but safe.
    """
    certificate = EnergyCertificate(
        scenario=Scenario(),
        model=made(
            mass_kg=2.0, top_speed_m_s=1.5, top_kinetic_energy_j=2.25,
            law=made(name="made up"), p_WP=(0.0, 0.0),
            clearances=lambda p: np.ones(len(p)), energy=lambda x: np.zeros(len(x)),
        ),
        passivity=made(covered=True, velocity_term="printed", to_dict=dict),
        contact_m=0.1,
        cell_m=0.5,
        x_m=np.array([0.0, 0.5]),
        y_m=np.array([1.0, 1.5, 2.0]),
        potential_j=np.array([[1.0, 4.75, 4.75], [6.0, 6.0, 0.0]]),
        free=np.array([[True, True, True], [True, True, False]]),
        escape_j=np.array(
            [[[5.0, 9.0, 5.0], [5.0, 5.0, 0.0]], [[7.0, 5.0, 4.0], [9.0, 5.0, 0.0]]]
        ),
        any_speed=np.array([[[0, 0, 0], [0, 1, 1]], [[0, 0, 1], [1, 1, 1]]]) > 0,
    )  # fmt: skip
    nan = math.nan
    speeds = [[1.5, 0.5, 0.5], [nan, 1.5, nan]]
    np.testing.assert_allclose(certificate.largest_speed(), speeds)
    document = certificate.to_dict()
    assert document["contact_energy_j"] == 4.0
    assert document["certified_at_rest_share"] == pytest.approx(4 / 5)
    assert document["certified_at_any_speed_share"] == pytest.approx(1 / 5)
    assert document["workspace_m"] == [0.0, 0.5, 1.0, 2.0]
    assert not document["start_certified"], "it is off the grid"


def test_a_start_among_moving_bodies_is_not_judged():
    """The certificate takes bodies to rest, and says nothing of others."""
    moves = {"source": {"waypoints_m": [[2.0, 0.0], [5.0, 0.0]]}, "obstacles": []}
    for changes, expected in (({}, False), (moves, True)):
        scenario = Scenario.model_validate({"law": "active"} | changes)
        found = certify_energy(scenario, cell_m=0.05).start_certified
        assert (found is None) == expected


def test_finer_cells_certify_more(two_boxes):
    scenario = two_boxes("active")
    shares = [certify_energy(scenario, cell_m=h).rest_share for h in (0.08, 0.04, 0.02)]
    assert shares == sorted(shares)


def test_energy_alone_certifies_less_than_with_the_clamp(certificates):
    certificate = certificates["conventional"]
    rng = np.random.default_rng(2)
    states = np.column_stack(
        [rng.uniform(-1.0, 5.5, 4000), rng.uniform(-2, 1.8, 4000), np.zeros((4000, 2))]
    )
    with_clamp = certificate.certified(states)
    without = certificate.certified(states, clamp=False)
    assert np.all(with_clamp[without])
    assert with_clamp.sum() > without.sum()


def test_no_start_in_contact_off_the_grid_or_too_fast_is_certified(certificates):
    certificate = certificates["conventional"]
    states = [[1.6, 0.35, 0, 0], [40.0, 0.0, 0, 0], [3.6, 0.0, 0.73, 0.0]]
    assert not certificate.certified(states).any()
    assert certificate.certified([[3.6, 0.0, 0.71, 0.0]]).all()


def test_without_a_law_only_the_shadow_of_the_goal_is_certified(two_boxes):
    """U = 0: the level at contact is that of the attraction alone."""
    certificate = certify_energy(two_boxes("none"), cell_m=0.02)
    assert try_certificate(certificate, starts=100).inside_collisions == 0
    assert certificate.rest_share < 0.7


def test_an_uncovered_velocity_term_is_left_out(two_boxes):
    strong = "laws.conventional.damping_n_s_m=1.2"
    certificate = certify_energy(two_boxes("conventional", strong), cell_m=0.05)
    assert certificate.term == "none"
    closing = certify_energy(
        two_boxes("conventional", strong), cell_m=0.05, velocity_term="closing"
    )
    assert closing.term == "closing"


def test_a_law_that_pulls_is_refused(two_boxes, tmp_path, monkeypatch):
    (tmp_path / "pulling.py").write_text(
        "def pull(c, s, laws):\n    return -1.0 + 0.0 * c\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValueError, match=r"law: .* pulls toward obstacles"):
        certify_energy(two_boxes("active", "law=pulling:pull"))


def test_a_law_of_ones_own_is_certified(two_boxes, tmp_path, monkeypatch):
    (tmp_path / "soft.py").write_text(
        "def soft(c, s, laws):\n    return 3.0 / (0.1 + c)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    certificate = certify_energy(two_boxes("active", "law=soft:soft"), cell_m=0.04)
    assert 0.0 < certificate.rest_share < 1.0
    assert try_certificate(certificate, starts=50).inside_collisions == 0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cell_m": 0.0}, "cell_m: 0.0 must be above 0"),
        ({"cell_m": 1e-4}, "cell_m: 0.0001 makes .* take at least"),
        ({"contact_m": 5.0}, r"contact_m: 5.0 must lie between 0 and .* 3.0 m"),
    ],
)
def test_bad_arguments_are_named(two_boxes, settings, message):
    with pytest.raises(ValueError, match=message):
        certify_energy(two_boxes("conventional"), **settings)
    with pytest.raises(ValueError, match="starts: 0 must be at least 1"):
        try_certificate(certify_energy(two_boxes("none"), cell_m=0.2), starts=0)
