"""How hard each law pushes, by distance and by speed.

Han 2019 describes its figure 6 in words, and Kim 2017 its own; both pictures
are missing. The forces here come from the blocks that simulate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from diagrams.building.laws import make_controller
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.ranging.collision_vector import SLOTS

#: Where curves are drawn, m and m/s (negative: the obstacle recedes).
DISTANCES_M = np.linspace(0.0, 3.0, 301)[1:]
SPEEDS_M_S = np.linspace(-1.0, 1.0, 201)
#: Where speeds vary, m: half of rho_0.
AT_DISTANCE_M = 0.4


@dataclass(frozen=True)
class LawCurves:
    """Force away from an obstacle straight ahead, under one law."""

    law: str
    """As ``Scenario.law``."""
    velocity_term: str
    """``printed`` or ``closing``."""
    distance_m: NDArray[np.float64]
    """(n,) m."""
    push_n: NDArray[np.float64]
    """(n,) force at these distances, the obstacle at rest, N."""
    at_distance_m: float
    """Distance at which the speed varies, m."""
    speed_m_s: NDArray[np.float64]
    """(k,) speed of approach, negative for a receding obstacle, m/s."""
    force_n: NDArray[np.float64]
    """(k,) force at these speeds, N."""


def law_curves(scenario: Scenario, laws: Iterable[str]) -> list[LawCurves]:
    """Samples the laws with a scenario's gains.

    Args:
        scenario: Its gains and ``robot`` count.
        laws: As ``Scenario.law``.

    Returns:
        One a law, forces in N.

    Raises:
        InputError: There is no such law, or it tells no forces.
    """
    curves = []
    for law in laws:
        controller = make_controller(scenario.with_robot(law=law))
        if not controller.HasOutputPort("forces_W"):
            raise InputError(
                "law", f"{law!r} has no output port forces_W to draw; use another law"
            )
        curves.append(
            LawCurves(
                law=law,
                velocity_term=scenario.follower.collision_vector.velocity_term,
                distance_m=DISTANCES_M,
                push_n=radial_forces(controller, DISTANCES_M, 0.0),
                at_distance_m=AT_DISTANCE_M,
                speed_m_s=SPEEDS_M_S,
                force_n=radial_forces(controller, AT_DISTANCE_M, SPEEDS_M_S),
            )
        )
    return curves


def radial_forces(
    controller: Any, c: ArrayLike, approach: ArrayLike
) -> NDArray[np.float64]:
    """Force away from an obstacle that one control period brought nearer.

    Args:
        controller: A block with the ports of ``RadialLawController``.
        c: (...) distances now, m, above 0; broadcast with ``approach``.
        approach: (...) how fast they have shrunk over the last period, m/s.

    Returns:
        (...) N, of the shape that both broadcast to.
    """
    context = controller.CreateDefaultContext()
    for name, size in (("p_WS_estimated", 2), ("pose_WB_estimated", 3), ("v_WP", 2)):
        controller.GetInputPort(name).FixValue(context, np.zeros(size))
    controller.GetInputPort("target_valid").FixValue(context, np.zeros(1))
    features = np.eye(SLOTS)[0]
    controller.GetInputPort("features").FixValue(context, features)
    forces = controller.GetOutputPort("forces_W")
    period_s = controller.GetUniquePeriodicDiscreteUpdateAttribute().period_sec()
    distances, speeds = np.broadcast_arrays(c, approach)
    found = []
    for now, speed in zip(distances.ravel(), speeds.ravel(), strict=True):
        _see(controller, context, now + speed * period_s)
        update = controller.EvalUniquePeriodicDiscreteUpdate(context)
        context.SetDiscreteState(update)
        _see(controller, context, now)
        found.append(-forces.Eval(context)[2])
    return np.array(found).reshape(distances.shape)


def _see(controller: Any, context: Any, distance: float) -> None:
    """An obstacle straight ahead, in the first slot."""
    vectors = np.zeros(2 * SLOTS)
    vectors[0] = distance
    controller.GetInputPort("collision_vectors_B").FixValue(context, vectors)
