"""Push of an obstacle straight ahead against the pull of a target behind it.

The robot drives straight toward an obstacle at rest. The law pushes the robot away from
the obstacle, and the attraction pulls the robot toward the target. The velocity term of
a law is the part of its force that depends on the speed of the obstacle. Only
``injected_share`` takes this part into account.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analysis.loops.radial_law import radial_law
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.catalog import LAWS

#: Laws whose gains ``phonotaxis design`` chooses: name, and rules for the choice.
DESIGNED_LAWS = {
    law.name: law.tuning for law in LAWS.values() if law.tuning is not None
}

#: Function from the distance of the obstacle, m, to the force away from it, N.
Push = Callable[[float], float]

#: Step between the distances at which a push is sampled, and upper limit of these
#: distances, m.
_STEP_M, _FARTHEST_M = 0.002, 3.0
#: Speeds at which a velocity term is sampled, as multiples of the top speed.
_SPEEDS = np.linspace(0.0, 2.0, 401)[1:]


def spring(law: str, scenario: Scenario) -> Push:
    """Returns the push of a law of ``DESIGNED_LAWS`` without its velocity term."""
    if law not in DESIGNED_LAWS:
        raise InputError(
            "law", f"{law!r} has no gains to choose; use {', '.join(DESIGNED_LAWS)}"
        )
    force = radial_law(scenario.with_robot(law=law)).function
    speed = DESIGNED_LAWS[law].spring_speed(getattr(scenario.follower.laws, law))
    return lambda c: force(c, speed)


def kinetic_energy(scenario: Scenario) -> float:
    """Returns the kinetic energy of the virtual mass at top speed, J."""
    robot = scenario.only.robot
    return 0.5 * robot.mass_kg * robot.top_speed_m_s**2


def net_barrier(push: Push, scenario: Scenario, meters_to_go: float) -> float:
    """Returns the largest energy that a robot loses on its way to an obstacle, J.

    Where the push exceeds the pull of the attraction, the robot loses kinetic energy.
    The result is the largest loss between any two points of the approach. The approach
    ends at the least distance that the sensors measure. If the loss is at least the
    kinetic energy at top speed, the robot stops before the obstacle. The attraction is
    zero at ``meters_to_go`` behind the surface of the obstacle.
    """
    c, forces = sampled_push(push, scenario)
    return largest_rise(
        forces - scenario.follower.attraction.stiffness_n_m * (c + meters_to_go)
    )


def sampled_push(
    push: Push, scenario: Scenario
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns (n,) ascending distances, m, and the (n,) pushes there, N.

    The first distance is the least range of the sensors.
    """
    c = np.arange(scenario.follower.ultrasonic.minimum_range_m, _FARTHEST_M, _STEP_M)
    return c, np.array([push(distance) for distance in c.tolist()])


def largest_rise(net: NDArray[np.float64]) -> float:
    """Returns the largest work against a force on the way between two distances, J.

    The way leads toward the obstacle. ``net`` has the (n,) forces away from the
    obstacle, N, at the distances of ``sampled_push``.
    """
    potential = np.concatenate([[0.0], np.cumsum(net[1:] + net[:-1]) * _STEP_M / 2.0])
    return float(np.max(potential - np.minimum.accumulate(potential)))


def barrier_from_reach_n_m(scenario: Scenario, meters_to_go: float) -> float:
    """Returns the K_0, N/m, with which the conventional law stops a robot.

    Within its reach rho_0, the law acts as a spring of stiffness K_0. The calculation
    ignores the speed limit of the robot within this reach. The largest energy of the
    spring, K_0 rho_0^2/2, must equal the sum of two energies:

    - The kinetic energy at top speed, which the robot has at the distance rho_0.
    - The work of the attraction from the distance rho_0 to the obstacle.

    The attraction is zero at ``meters_to_go`` behind the surface of the obstacle.
    """
    K_r = scenario.follower.attraction.stiffness_n_m
    reach = scenario.follower.laws.conventional.reach_m
    work = K_r / 2.0 * ((meters_to_go + reach) ** 2 - meters_to_go**2)
    return 2.0 * (kinetic_energy(scenario) + work) / reach**2


def rest_offset(law: str, scenario: Scenario) -> float:
    """Returns how far the leader at rest pushes the follower off the follow point, m.

    The leader is the robot that carries the source. The follow point is the point at
    the follow distance straight behind the leader. The law of the follower treats the
    body of the leader as an obstacle.
    """
    force = radial_law(scenario.with_robot(law=law)).function
    attraction = scenario.follower.attraction
    gap = attraction.follow_distance_m - scenario.source.length_m / 2.0

    def unbalanced(offset: float) -> float:
        return attraction.stiffness_n_m * offset - force(max(gap + offset, 1e-6), 0.0)

    # If the body of the leader covers the follow point, P rests outside the body.
    nearest = max(0.0, -gap)
    if unbalanced(nearest) >= 0.0:
        return nearest
    return float(brentq(unbalanced, nearest, 20.0))


def far_offset(law: str, scenario: Scenario) -> float:
    """Returns how far an echo at the largest sensor range displaces a robot, m.

    The robot rests where the spring of the attraction balances the push of this echo.
    """
    force = radial_law(scenario.with_robot(law=law)).function
    farthest = scenario.follower.ultrasonic.maximum_range_m
    return force(farthest, 0.0) / scenario.follower.attraction.stiffness_n_m


def injected_share(law: str, scenario: Scenario) -> float:
    """Returns how much power the velocity term can add, relative to the damping.

    The obstacle is at rest, and the robot recedes from it at the speed s. The force of
    the law at the distance c is f(c, s). The velocity term is h(s) = f(c, s) - f(c, 0)
    and adds at most the power |h(s)| s. The damping D_r of the attraction removes the
    power D_r s^2. The result is the largest ratio of these powers for all s up to twice
    the top speed, with c equal to half the reach rho_0 of the conventional law. If the
    ratio is below 1, the motion cannot gain energy at this distance.
    """
    force = radial_law(scenario.with_robot(law=law)).function
    within = 0.5 * scenario.follower.laws.conventional.reach_m
    speeds = scenario.only.robot.top_speed_m_s * _SPEEDS
    term = np.array([force(within, s) for s in speeds.tolist()]) - force(within, 0.0)
    damping = scenario.follower.attraction.damping_n_s_m
    return float(np.max(np.abs(term) / speeds)) / damping
