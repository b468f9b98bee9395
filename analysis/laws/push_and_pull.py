"""Push of an obstacle straight ahead against the pull of a target behind it.

The control point P of the robot moves head-on toward the obstacle. All forces act along
the line to the target. The obstacle is at rest. Only ``injected_share`` takes velocity
terms into account.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analysis.laws.radial_law import law_function
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.catalogue import LAWS

#: Laws whose gains the design chooses, by name, with their tuning.
DESIGNED_LAWS = {
    law.name: law.tuning for law in LAWS.values() if law.tuning is not None
}

#: Function from the distance of the obstacle, m, to the force away from it, N.
Push = Callable[[float], float]

#: The first number is the step between the distances at which a push is sampled, m.
#: The second number is the largest of these distances, m.
_STEP_M, _FARTHEST_M = 0.002, 3.0
#: Speeds at which a velocity term is sampled, as multiples of the top speed.
_SPEEDS = np.linspace(0.0, 2.0, 401)[1:]


def law_force(law: str, scenario: Scenario) -> Callable[..., float]:
    """Returns the force function f(c, s) of a law with the gains of a scenario.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains and the sensors.

    Returns:
        The function f(c, s), N, of the distance c, m, and the speed s, m/s.

    Raises:
        InputError: The design does not choose gains for this law.
    """
    if law not in DESIGNED_LAWS:
        raise InputError(
            "law", f"{law!r} has no gains to choose; use {', '.join(DESIGNED_LAWS)}"
        )
    return law_function(scenario.with_robot(law=law))


def spring(law: str, scenario: Scenario) -> Push:
    """Returns the push of a law at rest, without its velocity term.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains and the sensors.

    Returns:
        A function from the distance in m to the push in N.

    Raises:
        InputError: The design does not choose gains for this law.
    """
    force = law_force(law, scenario)
    speed = DESIGNED_LAWS[law].spring_speed(getattr(scenario.follower.laws, law))
    return lambda c: force(c, speed)


def kinetic_energy(scenario: Scenario) -> float:
    """Returns the kinetic energy of the virtual mass at top speed, J."""
    robot = scenario.only.robot
    return 0.5 * robot.mass_kg * robot.top_speed_m_s**2


def net_barrier(push: Push, scenario: Scenario, metres_to_go: float) -> float:
    """Returns the energy that push and pull together take from P during an approach.

    P is the control point of the robot, ahead of the axle. The pull of the attraction
    acts against the push during the whole approach. The speed is limited. Therefore,
    when the push becomes stronger than the pull, P has at most the kinetic energy of
    top speed. The barrier is the largest rise of the potential between any two points
    of the approach. The approach ends at the least distance that the sensors measure.

    Args:
        push: Push over distance; see ``spring``.
        scenario: The scenario with K_r and the least range of the sensors.
        metres_to_go: Distance from the surface of the obstacle to the point where the
            attraction rests, m.

    Returns:
        The energy in J. If the push is never stronger than the pull, the energy is 0.
    """
    c, forces = sampled_push(push, scenario)
    return largest_rise(
        forces - scenario.follower.attraction.stiffness_n_m * (c + metres_to_go)
    )


def sampled_push(
    push: Push, scenario: Scenario
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples a push at many distances, starting at the least range of the sensors.

    Args:
        push: Push over distance, N; see ``spring``.
        scenario: The scenario with the least range of the sensors.

    Returns:
        The first array has the (n,) distances, m. The second array has the (n,) forces,
        N.
    """
    c = np.arange(scenario.follower.ultrasonic.minimum_range_m, _FARTHEST_M, _STEP_M)
    return c, np.array([push(distance) for distance in c.tolist()])


def largest_rise(net: NDArray[np.float64]) -> float:
    """Returns the largest rise of the potential between two points of the approach.

    Args:
        net: (n,) push minus pull at the distances of ``sampled_push``, N.

    Returns:
        The rise in J, 0 or more.
    """
    potential = np.concatenate([[0.0], np.cumsum(net[1:] + net[:-1]) * _STEP_M / 2.0])
    return float(np.max(potential - np.minimum.accumulate(potential)))


def barrier_from_reach_n_m(scenario: Scenario, metres_to_go: float) -> float:
    """Returns K_0 of the conventional law for an approach without a speed limit.

    The law acts within its reach rho_0. The energy K_0 rho_0^2/2 of its spring is equal
    to the sum of two energies:

    - The kinetic energy at the distance rho_0.
    - The work of the attraction over the distance rho_0.

    Args:
        scenario: The scenario with the attraction, the reach rho_0, the mass, and the
            top speed.
        metres_to_go: Distance from the surface of the obstacle to the point where the
            attraction rests, m.

    Returns:
        K_0 in N/m.
    """
    K_r = scenario.follower.attraction.stiffness_n_m
    reach = scenario.follower.laws.conventional.reach_m
    work = K_r / 2.0 * ((metres_to_go + reach) ** 2 - metres_to_go**2)
    return 2.0 * (kinetic_energy(scenario) + work) / reach**2


def stiffest(law: str, scenario: Scenario) -> float:
    """Returns the largest stiffness of a law for an obstacle at rest.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains and the least range of the sensors.

    Returns:
        The largest slope -df/dc in N/m, over all distances that the sensors measure.
    """
    gains = getattr(scenario.follower.laws, law)
    nearest = scenario.follower.ultrasonic.minimum_range_m
    return DESIGNED_LAWS[law].stiffest(gains, nearest)


def rest_offset(law: str, scenario: Scenario) -> float:
    """Returns how far the body of the leader pushes P off the follow point at rest.

    The leader is the robot that carries the source. P is the control point of the
    follower, ahead of its axle. P is behind the leader, on the axis of the leader.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains, the follow distance, and the length of
            the leader.

    Returns:
        The offset in m, 0 or more.
    """
    force = law_force(law, scenario)
    K_r, follow = (
        scenario.follower.attraction.stiffness_n_m,
        scenario.follower.attraction.follow_distance_m,
    )
    gap = follow - scenario.source.length_m / 2.0

    def unbalanced(offset: float) -> float:
        return K_r * offset - force(max(gap + offset, 1e-6), 0.0)

    # If the body of the leader covers the follow point, P rests outside the body.
    nearest = max(0.0, -gap)
    if unbalanced(nearest) >= 0.0:
        return nearest
    return float(brentq(unbalanced, nearest, 20.0))


def far_offset(law: str, scenario: Scenario) -> float:
    """Returns how far an echo at the largest sensor range pushes P at rest.

    P is the control point of the robot, ahead of the axle.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains and the largest range of the sensors.

    Returns:
        The offset in m. If the law has a shorter reach, the offset is 0.
    """
    force = law_force(law, scenario)
    farthest = scenario.follower.ultrasonic.maximum_range_m
    return force(farthest, 0.0) / scenario.follower.attraction.stiffness_n_m


def injected_share(law: str, scenario: Scenario) -> float:
    """Returns the largest share of the dissipation that the velocity term can return.

    The obstacle is at rest, and the velocity term is h(s) = f(c, s) - f(c, 0). While
    the robot recedes at the speed s, the power of the printed term is at most h(s) s.
    The damping D_r takes the power D_r s^2. The share is the ratio of the two powers.
    The other part of the force, f(c, 0), has a potential. If the share is below 1, the
    motion cannot gain energy.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: The scenario with the gains, D_r, and the top speed.

    Returns:
        The largest share, 0 or more. The distance c is half the reach rho_0 of the
        conventional law.
    """
    force = law_force(law, scenario)
    within = 0.5 * scenario.follower.laws.conventional.reach_m
    speeds = scenario.only.robot.top_speed_m_s * _SPEEDS
    term = np.array([force(within, s) for s in speeds.tolist()]) - force(within, 0.0)
    return (
        float(np.max(np.abs(term) / speeds))
        / scenario.follower.attraction.damping_n_s_m
    )
