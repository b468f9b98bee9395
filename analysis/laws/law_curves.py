"""Curves of the force of each law over distance and over speed.

Han 2019 describes such curves in words (figure 6), and so does Kim 2017. The figures
themselves are missing. The forces in this module come from the blocks of the
simulation.
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

#: Distances of the curves, m.
DISTANCES_M = np.linspace(0.0, 3.0, 301)[1:]
#: Speeds of approach of the curves, m/s. A negative speed means that the obstacle
#: recedes.
SPEEDS_M_S = np.linspace(-1.0, 1.0, 201)
#: Distance for the curves over speed, m. This distance is half of rho_0.
AT_DISTANCE_M = 0.4


@dataclass(frozen=True)
class LawCurves:
    """Force of one law away from an obstacle straight ahead."""

    law: str
    """Name of the law in scenarios."""
    velocity_term: str
    """Velocity term of the scenario: ``printed`` or ``closing``."""
    distance_m: NDArray[np.float64]
    """(n,) distances of the obstacle, m."""
    push_n: NDArray[np.float64]
    """(n,) force at ``distance_m`` for an obstacle at rest, N."""
    at_distance_m: float
    """Distance for the curve over speed, m."""
    speed_m_s: NDArray[np.float64]
    """(k,) speeds of approach, m/s. A negative speed means that the obstacle
    recedes."""
    force_n: NDArray[np.float64]
    """(k,) force at ``speed_m_s``, N."""


def law_curves(scenario: Scenario, laws: Iterable[str]) -> list[LawCurves]:
    """Computes the force curves of laws with the gains of a scenario.

    Args:
        scenario: The scenario with the gains and the robot.
        laws: Names of the laws.

    Returns:
        One entry per law, with forces in N.

    Raises:
        InputError: A law does not exist, or its block has no output for forces.
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
    """Returns the force away from an obstacle after one control period of approach.

    Args:
        controller: A block with the ports of ``RadialLawController``.
        c: (...) distances at the end of the control period, m, above 0. The function
            broadcasts ``c`` and ``approach`` to one shape.
        approach: (...) speeds of approach during the control period, m/s. A negative
            speed means that the obstacle recedes.

    Returns:
        (...) force in N, with the broadcast shape.
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
    """Sets the first input vector of a controller to an obstacle straight ahead."""
    vectors = np.zeros(2 * SLOTS)
    vectors[0] = distance
    controller.GetInputPort("collision_vectors_B").FixValue(context, vectors)
