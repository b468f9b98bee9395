"""From requirements to gains: K_0, k_ref, D_0, d_ref of each law, and K_r, D_r, d_f.

Where requirements exclude each other, what comes first holds: the barrier
before the contact, the contact before the offset. docs/avoidance.md explains.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.optimize import brentq

from analysis.design.requirements import (
    DesignRequirements,
    allowed_stiffness,
    metres_to_go,
    with_gains,
)
from analysis.laws.push_and_pull import (
    DESIGNED_LAWS,
    injected_share,
    kinetic_energy,
    largest_rise,
    law_force,
    rest_offset,
    sampled_push,
    spring,
    stiffest,
)
from diagrams.scenario.participants import LawGains
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.active import matched_share
from systems.laws.catalogue import LAWS

#: Gains are rounded to so many figures.
_FIGURES = 3
#: Springs that are tried, N/m or N m.
_GAINS = (1e-3, 1e5)
#: Decay lengths that are tried by the rule ``matched``, m.
_ALPHAS_M = (0.05, 1.0)


def search_gains(scenario: Scenario, requirements: DesignRequirements) -> LawGains:
    """The gains that the requirements give to each law.

    Args:
        scenario: Reaches, limits of speed and saturations are its, as are the
            attraction, the robot and the sensors.
        requirements: What the gains must achieve.

    Returns:
        The scenario's parameters with the gains that were found.

    Raises:
        InputError: No gain meets a requirement that has to be met.
    """
    for law, tuning in DESIGNED_LAWS.items():
        scenario = _RULES[tuning.rule](scenario, law, requirements)
    return LawGains.model_validate(scenario.follower.laws.model_dump())


def gain_for_barrier(
    scenario: Scenario,
    law: str,
    field: str,
    requirements: DesignRequirements,
    **also: float,
) -> float:
    """The value of a gain with which the barrier is just met.

    Args:
        scenario: Everything else.
        law: Whose gain.
        field: The gain, N/m or N m; the push is proportional to it.
        requirements: See ``DesignRequirements``.
        also: Further gains as multiples of this one.

    Returns:
        In the unit of the field.

    Raises:
        InputError: No gain in a sensible range meets it.
    """
    to_go, energy = metres_to_go(scenario, requirements), kinetic_energy(scenario)

    unit = with_gains(scenario, law, **{field: 1.0}, **also)
    c, push = sampled_push(spring(law, unit), scenario)
    pull = scenario.follower.attraction.stiffness_n_m * (c + to_go)

    def missing(gain: float) -> float:
        return energy - largest_rise(gain * push - pull)

    return _root(missing, *_GAINS, f"laws.{law}.{field}")


def _barrier_gains(
    scenario: Scenario, law: str, requirements: DesignRequirements
) -> Scenario:
    """The spring from the barrier, the damper from the energy put back."""
    gains = LAWS[law].loop_gains
    assert gains is not None, f"{law} does not name the gains that tune it"
    spring_gain, damper_gain = gains
    # The secant of D_0 s is D_0: it puts back D_0/D_r.
    D_r = scenario.follower.attraction.damping_n_s_m
    damping = _rounded(requirements.injected_share * D_r)
    found = gain_for_barrier(scenario, law, spring_gain, requirements)
    found = _rounded(found, up=True)
    return with_gains(scenario, law, **{spring_gain: found, damper_gain: damping})


def _matched_gains(
    scenario: Scenario, law: str, requirements: DesignRequirements
) -> Scenario:
    """Both terms of the active law of 2019."""
    # A far echo meets the spring's tail as well: the second round knows it.
    for _ in range(2):
        scenario = _matched_damper(scenario, law, requirements)
        scenario = _matched_spring(scenario, law, requirements)
    return scenario


#: By ``Tuning.rule``.
_RULES = {"barrier": _barrier_gains, "matched": _matched_gains}


def _matched_damper(
    scenario: Scenario, law: str, requirements: DesignRequirements
) -> Scenario:
    """d_ref from the offset by a far echo, D_0 from the energy put back."""
    far = scenario.follower.ultrasonic.maximum_range_m
    tail = spring(law, scenario)(far)
    at_rest = (
        requirements.far_offset_m * scenario.follower.attraction.stiffness_n_m - tail
    )
    unit = {"reference_damping_n_s_m": 1.0, "matched_damping_n_s_m": 2.0}
    with_unit = with_gains(scenario, law, **unit)
    unit_term = law_force(law, with_unit)(far, 0.0) - spring(law, with_unit)(far)
    d_ref = _rounded(at_rest / unit_term)

    def excess(D_0: float) -> float:
        changed = with_gains(
            scenario,
            law,
            reference_damping_n_s_m=d_ref,
            matched_damping_n_s_m=D_0,
        )
        return injected_share(law, changed) - requirements.injected_share

    # Below sqrt(e) d_ref the term never rises above its value at rest.
    field = f"laws.{law}.matched_damping_n_s_m"
    D_0 = _root(excess, math.sqrt(math.e) * d_ref, 1e3 * d_ref, field)
    return with_gains(
        scenario,
        law,
        reference_damping_n_s_m=d_ref,
        matched_damping_n_s_m=_rounded(D_0),
    )


def _matched_spring(
    scenario: Scenario, law: str, requirements: DesignRequirements
) -> Scenario:
    """k_ref from the barrier, alpha from offset and contact.

    The longer alpha, the softer the push and the farther it reaches. Of those
    that meet the offset the longest is taken; where even that is too stiff
    for the contact, the shortest that is not.
    """
    reach = getattr(scenario.follower.laws, law).reach_m
    # Of the attraction alone: no alpha changes it.
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
        return rest_offset(law, with_alpha(alpha)) - scenario.stop.goal_margin_m

    def too_stiff(alpha: float) -> float:
        return stiffest(law, with_alpha(alpha)) - allowed

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
    """To three significant figures."""
    step = 10.0 ** (math.floor(math.log10(value)) + 1 - _FIGURES)
    steps = math.ceil(value / step - 1e-9) if up else round(value / step)
    return float(f"{steps * step:.12g}")
