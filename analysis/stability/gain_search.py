"""Search for gains of the laws that meet given requirements.

The gains are the stiffnesses K_0 and k_ref, and the dampings D_0 and d_ref. If the
gains cannot meet two requirements at once, the first of the two in this list has
priority:

- Barrier: the law stops the robot in front of an obstacle.
- Contact: the motion in front of an obstacle is stable.
- Offset: the law shifts the robot at rest from its follow point by little.

docs/avoidance.md explains these requirements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from scipy.optimize import brentq

from analysis.loops.push_and_pull import (
    DESIGNED_LAWS,
    injected_share,
    kinetic_energy,
    largest_rise,
    rest_offset,
    sampled_push,
    spring,
)
from analysis.loops.radial_law import radial_law
from analysis.stability.requirements import (
    Requirements,
    allowed_stiffness,
    meters_to_go,
    with_gains,
)
from diagrams.scenario.participants import LawGains
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.active import matched_share
from systems.laws.catalog import LAWS

#: Gains are rounded to this number of significant figures.
_FIGURES = 3
#: Least and largest spring gain of the search, N/m or N m.
_GAINS = (1e-3, 1e5)
#: Least and largest decay length alpha of the force in ``_matched_spring``, m.
_ALPHAS_M = (0.05, 1.0)


def search_gains(
    scenario: Scenario,
    requirements: Requirements,
    *,
    laws: Iterable[str] = tuple(DESIGNED_LAWS),
) -> LawGains:
    """Returns the gains of all laws of a scenario, with new gains for ``laws``.

    ``laws`` are names from ``DESIGNED_LAWS``. The search changes only the stiffness and
    damping of these laws; reaches, speed limits, and saturations stay. Raises
    InputError if no gain meets a requirement that must be met.
    """
    for law in laws:
        rule = _RULES[DESIGNED_LAWS[law].rule]
        scenario = rule(scenario, law, requirements)
    return LawGains.model_validate(scenario.follower.laws.model_dump())


def gain_for_barrier(
    scenario: Scenario,
    law: str,
    field: str,
    requirements: Requirements,
    **also: float,
) -> float:
    """Returns the value of a gain with which a law just stops the robot at an obstacle.

    During the approach, the push of the law minus the pull of the attraction must
    remove the kinetic energy that the robot has at top speed. ``field`` is the name of
    the gain, which is in N/m or N m. The push is proportional to this gain. ``also``
    has other gains of the law, as multiples of this gain. Raises InputError if no value
    from 1e-3 to 1e5 stops the robot.
    """
    to_go, energy = meters_to_go(scenario, requirements), kinetic_energy(scenario)

    unit = with_gains(scenario, law, **{field: 1.0}, **also)
    c, push = sampled_push(spring(law, unit), scenario)
    pull = scenario.follower.attraction.stiffness_n_m * (c + to_go)

    def missing(gain: float) -> float:
        return energy - largest_rise(gain * push - pull)

    return _root(missing, *_GAINS, f"laws.{law}.{field}")


def _barrier_gains(
    scenario: Scenario, law: str, requirements: Requirements
) -> Scenario:
    """Derives the stiffness and the damping of a law by the rule ``barrier``."""
    gains = LAWS[law].loop_gains
    assert gains is not None, f"{law} does not name the gains that tune it"
    spring_gain, damper_gain = gains
    # While the robot recedes at the speed s, the velocity term D_0 s adds the power
    # D_0 s^2, and the damping D_r of the attraction removes the power D_r s^2.
    D_r = scenario.follower.attraction.damping_n_s_m
    damping = _rounded(requirements.injected_share * D_r)
    found = gain_for_barrier(scenario, law, spring_gain, requirements)
    found = _rounded(found, up=True)
    return with_gains(scenario, law, **{spring_gain: found, damper_gain: damping})


def _matched_gains(
    scenario: Scenario, law: str, requirements: Requirements
) -> Scenario:
    """Derives all four gains of the active law of 2019 by the rule ``matched``."""
    # The damper term depends on the push by a far echo, and this push includes the
    # tail of the spring term. Only the second round has the final tail.
    for _ in range(2):
        scenario = _matched_damper(scenario, law, requirements)
        scenario = _matched_spring(scenario, law, requirements)
    return scenario


#: Functions that derive the gains, by ``Tuning.rule``.
_RULES = {"barrier": _barrier_gains, "matched": _matched_gains}


def _matched_damper(
    scenario: Scenario, law: str, requirements: Requirements
) -> Scenario:
    """Derives the two gains d_ref and D_0 of the damper term.

    With d_ref, an echo at the largest sensor range shifts P at rest by
    ``far_offset_m``. With D_0, the velocity term adds the share ``injected_share`` of
    the power that the damping D_r removes.
    """
    far = scenario.follower.ultrasonic.maximum_range_m
    tail = spring(law, scenario)(far)
    at_rest = (
        requirements.far_offset_m * scenario.follower.attraction.stiffness_n_m - tail
    )
    unit = {"reference_damping_n_s_m": 1.0, "matched_damping_n_s_m": 2.0}
    with_unit = with_gains(scenario, law, **unit)
    force = radial_law(with_unit.with_robot(law=law)).function
    unit_term = force(far, 0.0) - spring(law, with_unit)(far)
    d_ref = _rounded(at_rest / unit_term)

    def with_damping(D_0: float) -> Scenario:
        gains = {"reference_damping_n_s_m": d_ref, "matched_damping_n_s_m": D_0}
        return with_gains(scenario, law, **gains)

    def excess(D_0: float) -> float:
        return injected_share(law, with_damping(D_0)) - requirements.injected_share

    # If D_0 is below sqrt(e) d_ref, the term never exceeds its value at rest.
    field = f"laws.{law}.matched_damping_n_s_m"
    D_0 = _root(excess, math.sqrt(math.e) * d_ref, 1e3 * d_ref, field)
    return with_damping(_rounded(D_0))


def _matched_spring(
    scenario: Scenario, law: str, requirements: Requirements
) -> Scenario:
    """Derives the two gains of the spring term of the active law of 2019.

    The gain k_ref follows from the kinetic energy that the law must remove. The ratio
    of the two gains follows from the decay length alpha of the force. With a longer
    alpha, the force is softer and reaches farther. The function chooses alpha in two
    steps:

    - It takes the longest alpha with an acceptable offset at rest.
    - If the force is then too stiff for a stable contact, it takes the shortest alpha
      with a stable contact.
    """
    reach = getattr(scenario.follower.laws, law).reach_m
    # This limit depends on the attraction alone, and not on alpha.
    allowed = allowed_stiffness(scenario, requirements)

    def with_alpha(alpha: float) -> Scenario:
        inverse_ratio = matched_share(reach, alpha)
        k_ref = gain_for_barrier(
            scenario,
            law,
            "reference_stiffness_n_m",
            requirements,
            matched_stiffness_n_m=inverse_ratio,
        )
        return with_gains(
            scenario,
            law,
            reference_stiffness_n_m=_rounded(k_ref),
            matched_stiffness_n_m=_rounded(k_ref * inverse_ratio),
        )

    def too_far(alpha: float) -> float:
        return rest_offset(law, with_alpha(alpha)) - requirements.rest_offset_m

    def too_stiff(alpha: float) -> float:
        softer = with_alpha(alpha).with_robot(law=law)
        return radial_law(softer).stiffest_n_m - allowed

    field = f"laws.{law}.reference_stiffness_n_m"
    alpha = _root(too_far, *_ALPHAS_M, field)
    if too_stiff(alpha) > 0.0:
        alpha = _root(too_stiff, alpha, _ALPHAS_M[1], field)
    return with_alpha(alpha)


def _root(
    function: Callable[[float], float], low: float, high: float, field: str
) -> float:
    if function(low) * function(high) > 0.0:
        raise InputError(
            f"{field}",
            f"no value from {low:g} to {high:g} meets the requirements; change "
            "attraction or robot",
        )
    return float(brentq(function, low, high, rtol=1e-6))


def _rounded(value: float, *, up: bool = False) -> float:
    """Rounds a value to three significant figures; with ``up``, never down."""
    step = 10.0 ** (math.floor(math.log10(value)) + 1 - _FIGURES)
    steps = math.ceil(value / step - 1e-9) if up else round(value / step)
    return float(f"{steps * step:.12g}")
