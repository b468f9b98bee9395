"""No simulated start contradicts an energy certificate, whatever the layout."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.energy.certificate_trials import try_certificate
from analysis.energy.energy_certificate import certify_energy
from diagrams import Scenario, load_scenario
from systems.framework.input_error import InputError

LAWS = ("conventional", "active", "active2017")


def random_scenario(seed: int) -> Scenario:
    """One to three boxes, turned anyhow, and gains within a factor of a few."""
    rng = np.random.default_rng(seed)

    def factor() -> float:
        return float(np.exp(rng.uniform(-0.7, 0.7)))

    law = LAWS[seed % 3]
    boxes = ", ".join(
        f"{{name: b{k}, size_m: [{rng.uniform(0.02, 0.6):.3f}, "
        f"{rng.uniform(0.02, 0.6):.3f}], heading_deg: {rng.uniform(0, 180):.1f}, "
        f"waypoints_m: [[{rng.uniform(0.8, 3.5):.3f}, {rng.uniform(-1.2, 1.2):.3f}]]}}"
        for k in range(rng.integers(1, 4))
    )
    d_ref = 0.2 * factor()
    overrides = [
        f"law={law}",
        f"seed={seed}",
        f"obstacles=[{boxes}]",
        f"attraction.stiffness_n_m={2.0 * factor():.3f}",
        f"attraction.damping_n_s_m={1.0 * factor():.3f}",
        f"attraction.follow_distance_m={rng.choice([0.0, 0.6, 1.2]):.1f}",
        f"collision_vector.velocity_term={rng.choice(['printed', 'closing'])}",
        f"laws.conventional.stiffness_n_m={16.0 * factor():.3f}",
        f"laws.conventional.damping_n_s_m={0.8 * factor():.3f}",
        f"laws.active.reference_stiffness_n_m={120.0 * factor():.3f}",
        f"laws.active.reference_damping_n_s_m={d_ref:.3f}",
        f"laws.active2017.distance_gain_j={1.2 * factor():.3f}",
        "collision_vector.aggregation="
        + ("sum" if boxes.count("name") < 3 and seed % 2 else "nearest"),
    ]
    try:
        return load_scenario("two_static_obstacles", overrides)
    except InputError:  # a box stands on the robot or on the source
        return random_scenario(seed + 1000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_certified_start_collides(seed):
    certificate = certify_energy(random_scenario(seed), cell_m=0.03)
    trials = try_certificate(certificate, starts=60, duration_s=30.0)
    assert trials.inside_collisions == 0
    rises = trials.inside.energy_rises_j
    assert rises.max(initial=0.0) < 2e-3
