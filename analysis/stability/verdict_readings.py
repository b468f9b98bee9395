"""What the verdicts of the stability report are about: numbers of its parts.

Each function takes the study and returns a number, or says why there is none.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from analysis.linear.contact_mode import contact_spectral_radius
from analysis.linear.loop_uncertainty import law_stiffness
from analysis.stability.law_analysis import Study
from analysis.stability.margin_parts import Margins, least_damped

__all__ = [
    "Reading",
    "read_contact",
    "read_cycle",
    "read_damping",
    "read_decay",
    "read_delay",
    "read_jams",
    "read_offset",
    "read_passive",
    "read_prediction",
    "read_routes",
    "read_start",
    "read_trials",
    "read_worst_case",
    "read_worst_margin",
]

#: A number, or why there is none.
Reading = float | str


def _at(study: Study) -> Any:
    return study.need("equilibria").at


def read_decay(study: Study) -> Reading:
    """Growth of the slowest motion about rest, 1/s."""
    return float(_at(study).eigenvalues.real.max())


def read_damping(study: Study) -> Reading:
    """Damping ratio of the least damped slow mode."""
    pole = least_damped(_at(study).eigenvalues)
    return -pole.real / abs(pole)


def read_worst_margin(name: str, *, largest: bool) -> Callable[[Study], Reading]:
    """The worst of a margin over all cuts and directions.

    Args:
        name: Field of ``LoopMargins``, or ``disk``.
        largest: Whether the largest is the worst.

    Returns:
        Reads it from a study, in the unit of the field; a text says why there is none.
    """

    def read(study: Study) -> Reading:
        margins: Margins | None = study.found.get("margins")
        if not margins or not margins.implemented:
            return "margins were not computed"
        values = [
            m.margins.disk.alpha if name == "disk" else getattr(m.margins, name)
            for m in margins.implemented
        ]
        return float(max(values) if largest else min(values))

    return read


def read_delay(study: Study) -> Reading:
    """Least exact delay margin, s."""
    data = study.found.get("sampled")
    if not data or not data.margins:
        return "delay margins were not computed"
    return float(min(margin.delay_s for margin in data.margins))


def read_cycle(study: Study) -> Reading:
    """Largest multiplier of the burst cycle with today's hold."""
    data = study.found.get("burst_cycle")
    if not data:
        return "the burst cycle was not computed"
    today = next(cycle for cycle in data.cycles if cycle.hold == data.today)
    return today.largest


def read_jams(study: Study) -> Reading:
    """Sinks outside the goal: a run that ends there is stuck or out of time."""
    points = study.need("equilibria").search.points
    scenario = study.scenario
    margin = scenario.goal_radius_m - scenario.attraction.follow_distance_m
    return float(sum(p.stable and p.offset_m > margin for p in points))


def read_offset(study: Study) -> Reading:
    """Distance from the follow point at rest, m."""
    return round(abs(float(_at(study).offset_m)), 9)


def read_contact(study: Study, ticks: int) -> Reading:
    """Growth of the contact mode at the law's largest slope, 1/s.

    Args:
        study: Has the scenario.
        ticks: Age of the position that the springs act on, periods.

    Returns:
        1/s, negative where it decays; a text says why there is none.
    """
    scenario = study.scenario
    stiffness = law_stiffness(scenario)
    if stiffness <= 0.0:
        return "the law does not push off obstacles"
    total = scenario.attraction.stiffness_n_m + stiffness
    radius = contact_spectral_radius(scenario, total, latency_ticks=ticks)
    return math.log(radius) / scenario.tick_s


def read_worst_case(key: str) -> Callable[[Study], Reading]:
    """Growth in the worst case of a robustness part, 1/s."""

    def read(study: Study) -> Reading:
        data = study.found.get(key)
        if not data:
            return "it was not computed"
        return math.log(data.cloud.worst_radius) / study.scenario.tick_s

    return read


def read_passive(study: Study) -> Reading:
    """Largest power of the velocity term over that of D_r."""
    data = study.found.get("energy_balance")
    if not data:
        return "the law has no radial force"
    passivity = data.passivity
    if passivity.attraction_damping_n_s_m == 0.0:
        return "there is no damping to compare with"
    share = passivity.largest_injection_n_s_m / passivity.attraction_damping_n_s_m
    return float(share)


def read_start(study: Study) -> Reading:
    """1 where no path that the energy allows leads from the start to contact."""
    data = study.found.get("certificates")
    if not data:
        return "there is no energy certificate"
    return float(data[0].certificate.start_certified)


def read_trials(study: Study) -> Reading:
    """Collisions of simulated certified starts."""
    data = study.found.get("certificates")
    return float(data[0].trials.inside_collisions) if data else "no certificate"


def read_routes(study: Study) -> Reading:
    """Largest difference of the two one-period matrices."""
    data = study.found.get("linear_models")
    return data.routes.matrix_difference if data else "no linear models"


def read_prediction(study: Study) -> Reading:
    """Error of frequency or damping of a small step, per cent."""
    data = study.found.get("step")
    if not data:
        return "no step was simulated"
    return 100.0 * max(abs(data.frequency_error), abs(data.damping_error))
