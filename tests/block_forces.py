"""Force of a law, read at the ports of the controller's block."""

from __future__ import annotations

from diagrams.building.laws import make_controller
from diagrams.scenario.scenario import Scenario
from phonotaxis.testing import Bench


def block_force(scenario: Scenario, distance_m: float, approach_m_s: float) -> float:
    """Returns the force of the controller's block after one period of approach, N.

    Args:
        scenario: Scenario with the law.
        distance_m: Distance of an obstacle straight ahead at the end of the period, m.
        approach_m_s: Speed of approach during the period, m/s.

    Returns:
        Force away from the obstacle, N.
    """
    before = distance_m + approach_m_s * scenario.tick_s
    at = Bench(
        make_controller(scenario),
        p_WS_estimated=[0.0] * 2,
        pose_WB_estimated=[0.0] * 3,
        v_WP=[0.0] * 2,
        target_valid=0.0,
        features=[1.0, 0.0, 0.0],
        collision_vectors_B=[before, 0.0, 0.0, 0.0, 0.0, 0.0],
    )
    at.tick().set(collision_vectors_B=[distance_m, 0.0, 0.0, 0.0, 0.0, 0.0])
    return -float(at.output("forces_W")[2])
