"""Certified starts in the full diagram."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from diagrams.running.stop_rules import Collision
from studies.proofs.diagram_trials import _mechanism, _pose, try_diagram


def test_runs_begin_where_and_as_fast_as_they_should(two_boxes):
    """Without forces and with exact wheels P goes on along its velocity."""
    free = (
        "attraction.stiffness_n_m=0",
        "attraction.damping_n_s_m=0",
        "duration_s=0.5",
    )
    scenario = two_boxes("conventional", *free, "hearing=ideal")
    certificate = certify_energy(scenario, cell_m=0.1)
    trials = try_diagram(certificate, starts=3)
    assert set(trials.causes) <= {"timeout", "unsettled", "reached"}
    for state in trials.starts:
        pose = _pose(state, scenario)
        heading = np.array([math.cos(pose[2]), math.sin(pose[2])])
        np.testing.assert_allclose(pose[:2] + 0.175 * heading, state[:2])
        np.testing.assert_allclose(heading * np.hypot(*state[2:]), state[2:])


def test_starts_are_those_of_the_certificates_own_trials(two_boxes):
    certificate = certify_energy(
        two_boxes("conventional", "duration_s=0.1"), cell_m=0.05
    )
    own = try_certificate(certificate, starts=20, duration_s=0.1).inside.starts
    trials = try_diagram(certificate, starts=10)
    assert trials.skipped < 10
    np.testing.assert_array_equal(
        trials.starts, [s for s in own.tolist() if s in trials.starts.tolist()][:10]
    )


def test_rate_counts_and_skips(two_boxes):
    certificate = certify_energy(two_boxes("conventional"), cell_m=0.05)
    trials = try_diagram(certificate, starts=8)
    found = trials.to_dict()
    assert sum(found["causes"].values()) == found["runs"] == 8
    assert sum(found["mechanisms"].values()) == found["collisions"]
    rate = trials.collision_rate
    assert rate.low <= rate.value == found["collisions"] / 8 <= rate.high
    again = try_diagram(certificate, starts=2)
    assert again.causes == trials.causes[:2]


@pytest.mark.parametrize(
    ("place", "mechanism"),
    [((0.2, 0.0), "ahead"), ((0.0, 0.42), "beside"), ((-0.2, 0.0), "behind")],
)
def test_mechanism_is_where_the_contact_lies(two_boxes, place, mechanism):
    """A small box at the edge of a robot that stands at the origin."""
    box = (
        f"obstacles=[{{name: box, size_m: [0.05, 0.05], waypoints_m: [{list(place)}]}}]"
    )
    scenario = two_boxes("conventional", "start.position_m=[-2, 0]", box)
    collision = Collision("box", "robot", 0.0)
    assert _mechanism(scenario, np.zeros(3), collision) == mechanism


def test_too_many_starts_are_refused(two_boxes):
    certificate = certify_energy(two_boxes("conventional"), cell_m=0.05)
    with pytest.raises(ValueError, match="starts: 0 must be at least 1"):
        try_diagram(certificate, starts=0)
    with pytest.raises(ValueError, match=r"starts: only .* use fewer than 50000"):
        try_diagram(certificate, starts=50_000)
