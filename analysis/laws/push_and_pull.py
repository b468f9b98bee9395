"""One obstacle straight ahead of a target: what the push holds, and what it costs.

P drives head-on at an obstacle with the target some way behind it. All forces
are along the line; the obstacle rests and the velocity terms are left out.
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

#: The laws whose gains are to be chosen, by name.
DESIGNED_LAWS = {
    law.name: law.tuning for law in LAWS.values() if law.tuning is not None
}

#: Force away from the obstacle, N, at a distance in m.
Push = Callable[[float], float]

#: Distances at which a push is sampled, m.
_STEP_M, _FARTHEST_M = 0.002, 3.0
#: Speeds at which a velocity term is sampled, as shares of twice the top speed.
_SPEEDS = np.linspace(0.0, 2.0, 401)[1:]


def law_force(law: str, scenario: Scenario) -> Callable[..., float]:
    """A law with the scenario's gains.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: Its gains and sensors count.

    Returns:
        ``f(c, s)`` in N, of m and m/s.

    Raises:
        InputError: The law has no gains to choose.
    """
    if law not in DESIGNED_LAWS:
        raise InputError(
            "law", f"{law!r} has no gains to choose; use {', '.join(DESIGNED_LAWS)}"
        )
    return law_function(scenario.with_robot(law=law))


def spring(law: str, scenario: Scenario) -> Push:
    """A law's push at rest, without its velocity term.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: Its gains and sensors count.

    Returns:
        Push in N at a distance in m.

    Raises:
        InputError: The law has no gains to choose.
    """
    force = law_force(law, scenario)
    speed = DESIGNED_LAWS[law].spring_speed(getattr(scenario.follower.laws, law))
    return lambda c: force(c, speed)


def kinetic_energy(scenario: Scenario) -> float:
    """Of the virtual mass at top speed, J."""
    robot = scenario.only.robot
    return 0.5 * robot.mass_kg * robot.top_speed_m_s**2


def net_barrier(push: Push, scenario: Scenario, metres_to_go: float) -> float:
    """Energy that push less pull takes from P on its way to the obstacle, J.

    The attraction does work against the push all the way. Speed is limited, so
    that P enters the stretch in which the push prevails with the kinetic
    energy of top speed at most: what counts is the largest rise of the
    potential over any stretch of the way in, down to the nearest distance that
    the sensors tell.

    Args:
        push: See ``spring``.
        scenario: K_r and the sensors' least range are used.
        metres_to_go: From the obstacle's surface to where the attraction
            rests, m.

    Returns:
        J; 0 where the push never prevails.
    """
    c, forces = sampled_push(push, scenario)
    return largest_rise(
        forces - scenario.follower.attraction.stiffness_n_m * (c + metres_to_go)
    )


def sampled_push(
    push: Push, scenario: Scenario
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A push at many distances, from the sensors' least range on.

    Args:
        push: Force at a distance, N; see ``spring``.
        scenario: The sensors' least range is used.

    Returns:
        (n,) distances, m, and (n,) forces, N.
    """
    c = np.arange(scenario.follower.ultrasonic.minimum_range_m, _FARTHEST_M, _STEP_M)
    return c, np.array([push(distance) for distance in c.tolist()])


def largest_rise(net: NDArray[np.float64]) -> float:
    """Largest rise of the potential over any stretch of the way in, J.

    Args:
        net: (n,) push less pull at the distances of ``sampled_push``, N.
    """
    potential = np.concatenate([[0.0], np.cumsum(net[1:] + net[:-1]) * _STEP_M / 2.0])
    return float(np.max(potential - np.minimum.accumulate(potential)))


def barrier_from_reach_n_m(scenario: Scenario, metres_to_go: float) -> float:
    """K_0 of the conventional law without the limit of speed, N/m.

    Its spring K_0 rho_0^2/2 holds the kinetic energy at rho_0 and the work of
    the attraction over all of rho_0.

    Args:
        scenario: Attraction, reach rho_0, mass and top speed.
        metres_to_go: From the obstacle's surface to where the attraction rests, m.

    Returns:
        N/m.
    """
    K_r = scenario.follower.attraction.stiffness_n_m
    reach = scenario.follower.laws.conventional.reach_m
    work = K_r / 2.0 * ((metres_to_go + reach) ** 2 - metres_to_go**2)
    return 2.0 * (kinetic_energy(scenario) + work) / reach**2


def stiffest(law: str, scenario: Scenario) -> float:
    """The slope at the worst distance to rest at.

    Args:
        law: One of ``DESIGNED_LAWS``.
        scenario: Its gains and the sensors' least range count.

    Returns:
        Largest -df/dc at rest, N/m.
    """
    gains = getattr(scenario.follower.laws, law)
    nearest = scenario.follower.ultrasonic.minimum_range_m
    return DESIGNED_LAWS[law].stiffest(gains, nearest)


def rest_offset(law: str, scenario: Scenario) -> float:
    """How far the master robot's body pushes P off the follow point at rest, m.

    P stands behind the master robot, on its axis.

    Args:
        law: As ``Scenario.law``.
        scenario: Gains, follow distance and the master robot's length.

    Returns:
        m, 0 or more.
    """
    force = law_force(law, scenario)
    K_r, follow = (
        scenario.follower.attraction.stiffness_n_m,
        scenario.follower.attraction.follow_distance_m,
    )
    gap = follow - scenario.source.length_m / 2.0

    def unbalanced(offset: float) -> float:
        return K_r * offset - force(max(gap + offset, 1e-6), 0.0)

    # Where the master robot reaches the follow point, P rests outside of it.
    nearest = max(0.0, -gap)
    if unbalanced(nearest) >= 0.0:
        return nearest
    return float(brentq(unbalanced, nearest, 20.0))


def far_offset(law: str, scenario: Scenario) -> float:
    """How far an echo at the sensors' limit pushes a resting P, m.

    Args:
        law: As ``Scenario.law``.
        scenario: Gains, and the sensors' largest range.

    Returns:
        m, 0 where the law ends before.
    """
    force = law_force(law, scenario)
    farthest = scenario.follower.ultrasonic.maximum_range_m
    return force(farthest, 0.0) / scenario.follower.attraction.stiffness_n_m


def injected_share(law: str, scenario: Scenario) -> float:
    """Largest share of D_r's dissipation that |dC/dt| can put back.

    Before a resting obstacle the printed velocity term h(s) = f(c, s) - f(c, 0)
    does work h(s) ds at most while P recedes at s, and D_r takes D_r s ds; the
    rest, f(c, 0), has a potential. Below 1 the motion cannot gain energy.

    Args:
        law: As ``Scenario.law``.
        scenario: Gains, D_r and top speed.

    Returns:
        A ratio, 0 or more, at half the reach rho_0.
    """
    force = law_force(law, scenario)
    within = 0.5 * scenario.follower.laws.conventional.reach_m
    speeds = scenario.only.robot.top_speed_m_s * _SPEEDS
    term = np.array([force(within, s) for s in speeds.tolist()]) - force(within, 0.0)
    return (
        float(np.max(np.abs(term) / speeds))
        / scenario.follower.attraction.damping_n_s_m
    )
