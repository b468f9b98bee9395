"""The criteria of the stability report, and functions that read their numbers.

Each reading function takes a study and returns a number. If the study has no such
number, the function returns the reason as a text.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from analysis.laws.radial_law import radial_law
from analysis.linear.contact_mode import contact_model
from analysis.stability.law_analysis import Study
from analysis.stability.margin_parts import Margins, least_damped
from analysis.stability.verdicts import YES_OR_NO, Criterion

#: A number, or a text with the reason why the number does not exist.
Reading = float | str


def _of(
    key: str, missing: str, number: Callable[[Any], float | None]
) -> Callable[[Study], Reading]:
    """Returns a function that reads a number from the data of one part of the report.

    If the part has no data or no such number, that function returns ``missing``.
    """

    def read(study: Study) -> Reading:
        data = study.found.get(key)
        value = number(data) if data else None
        return missing if value is None else float(value)

    return read


def _at(study: Study) -> Any:
    return study.need("equilibria").at


def read_decay(study: Study) -> Reading:
    """Returns the growth rate of the slowest motion about the point of rest, 1/s."""
    return float(_at(study).eigenvalues.real.max())


def read_damping(study: Study) -> Reading:
    """Returns the damping ratio of the least damped slow mode."""
    pole = least_damped(_at(study).eigenvalues)
    return -pole.real / abs(pole)


def read_worst_margin(name: str, *, largest: bool) -> Callable[[Study], Reading]:
    """Makes a function that reads the worst value of one stability margin.

    The stability report cuts the loop at several places, and for two directions of
    motion. The worst value is the worst of all these cuts.

    Args:
        name: Name of a field of ``LoopMargins``, or ``disk`` for the size of the disk
            margin.
        largest: Whether the largest value is the worst value. Otherwise, the smallest
            value is the worst value.

    Returns:
        A function that takes a study and returns the worst value in the unit of the
        field. If no margins were computed, the function returns a text that says so.
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


#: Reads the least exact delay margin, s.
read_delay = _of(
    "sampled",
    "delay margins were not computed",
    lambda data: min((m.delay_s for m in data.margins), default=None),
)
#: Reads the largest multiplier of the burst cycle with the hold of the scenario.
read_cycle = _of(
    "burst_cycle",
    "the burst cycle was not computed",
    lambda data: next(c.largest for c in data.cycles if c.hold == data.today),
)


def read_jams(study: Study) -> Reading:
    """Counts the places outside the goal where the robot can get stuck.

    Such a place is a stable equilibrium or an attractive switching point. A switching
    point is a point at which several bodies are equally near. A run that ends at such a
    place has the outcome "stuck" or "timeout".
    """
    search, scenario = study.need("equilibria").search, study.scenario
    margin = scenario.goal_radius_m - scenario.follower.attraction.follow_distance_m
    p_WS = scenario.source.path().pose(0.0)[:2]
    jams = sum(p.stable and p.offset_m > margin for p in search.points)
    jams += sum(
        p.attractive and math.dist(p.p_WP, p_WS) > scenario.goal_radius_m
        for p in search.switching
    )
    return float(jams)


def read_offset(study: Study) -> Reading:
    """Returns the distance between the point of rest and the follow point, m."""
    return round(abs(float(_at(study).offset_m)), 9)


def read_contact(study: Study, ticks: int) -> Reading:
    """Returns the growth rate of the motion in front of an obstacle, 1/s.

    The spring to the obstacle has the largest stiffness of the law.

    Args:
        study: The study with the scenario.
        ticks: Age of the measured position of the obstacle, in control periods.

    Returns:
        The growth rate in 1/s, negative if the motion decays. If the law does not push
        away from obstacles, the result is a text that says so.
    """
    scenario = study.scenario
    stiffness = radial_law(scenario).stiffest_n_m
    if stiffness <= 0.0:
        return "the law does not push off obstacles"
    total = scenario.follower.attraction.stiffness_n_m + stiffness
    return contact_model(scenario, total, latency_ticks=ticks).growth_per_s


def read_worst_case(key: str) -> Callable[[Study], Reading]:
    """Makes a function that reads the growth rate for the worst parameter values, 1/s.

    The argument is the key of a part about uncertain parameters.
    """

    def read(study: Study) -> Reading:
        data = study.found.get(key)
        if not data:
            return "it was not computed"
        return float(data.cloud.worst_growth_per_s)

    return read


def read_passive(study: Study) -> Reading:
    """Returns the largest power of the velocity term relative to the power of D_r.

    The velocity term of a law can add energy to the motion, and the damping D_r removes
    energy. If the result is at most 1, the loop is passive.
    """
    data = study.found.get("energy_balance")
    if not data:
        return "the law has no radial force"
    passivity = data.passivity
    if passivity.attraction_damping_n_s_m == 0.0:
        return "there is no damping to compare with"
    share = passivity.largest_injection_n_s_m / passivity.attraction_damping_n_s_m
    return float(share)


def read_start(study: Study) -> Reading:
    """Returns 1 if the energy certificate covers the start of the robot, otherwise 0.

    The certificate covers the start if the energy of the robot is too low for every
    path to a collision. If there is no certificate, or if bodies move, the result is a
    text.
    """
    data = study.found.get("certificates")
    if not data:
        return "there is no energy certificate"
    certified = data[0].certificate.start_certified
    if certified is None:
        return "bodies move, and the certificate is about bodies at rest"
    return float(certified)


#: Reads the number of simulated runs that start in the certified set and collide.
read_trials = _of(
    "certificates",
    "no certificate",
    lambda data: data[0].trials.inside_collisions,
)
#: Reads the largest difference between the two computations of the one-period
#: matrix.
read_routes = _of(
    "linear_models", "no linear models", lambda data: data.routes.matrix_difference
)
#: Reads the error of the predicted frequency or damping of a small step, whichever
#: is larger, in percent.
read_prediction = _of(
    "step",
    "no step was simulated",
    lambda data: 100.0 * max(abs(data.frequency_error), abs(data.damping_error)),
)

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
_SENSITIVITY = "usual: M_s of 1.2 to 2.0 (Astrom and Murray)"
_OURS = "set by this project"

#: The criteria, each with the function that reads its number.
CRITERIA: dict[Criterion, Callable[[Study], Reading]] = {
    Criterion(
        "growth at rest", "1/s", "below", 0.0,
        "small deviations from the follow point die out",
        "small deviations from the follow point grow",
        "stability",
    ): read_decay,
    Criterion(
        "damping ratio at rest", "", "at least", 0.4,
        "overshoots are small",
        "it overshoots and swings for several cycles",
        "usual: 0.4 to 0.8 (Astrom and Murray)",
    ): read_damping,
    Criterion(
        "least phase margin", "deg", "at least", 45.0,
        "every cut loop tolerates the usual extra phase lag or lead",
        "a small extra phase makes the loop oscillate",
        _MARGINS,
    ): read_worst_margin("phase_margin_deg", largest=False),
    Criterion(
        "least gain margin", "dB", "at least", 6.0,
        "gains may double, or fall to half",
        "a gain that is off by less than a factor of two, up or down, makes it "
        "unstable",
        _MARGINS,
    ): read_worst_margin("gain_margin_db", largest=False),
    Criterion(
        "largest sensitivity peak", "", "at most", 2.0,
        "disturbances are hardly amplified",
        "disturbances near the crossover are amplified more than twice",
        _SENSITIVITY,
    ): read_worst_margin("sensitivity_peak", largest=True),
    Criterion(
        "least disk margin", "", "at least", 2.0 / 3.0,
        "gain and phase may change at once, by 6 dB and 37 deg",
        "a change of gain and phase at once makes the loop oscillate early",
        "alpha = 2/3: 6 dB in each direction (Seiler, Packard and Gahinet 2020)",
    ): read_worst_margin("disk", largest=False),
    Criterion(
        "least delay margin", "s", "at least", 0.1,
        "0.1 s more delay does no harm",
        "less than 0.1 s more delay makes it oscillate",
        "set by this project: four ticks of 25 ms; exact margin of the sampled loop",
    ): read_delay,
    Criterion(
        "deviation remaining after a burst cycle", "", "below", 1.0,
        "it settles although the source is silent most of the time",
        "it swings ever farther because the source is silent most of the time",
        "stability over a cycle of the sound",
    ): read_cycle,
    Criterion(
        "growth where the law is stiffest", "1/s", "below", 0.0,
        "it comes to rest however hard it presses against an obstacle",
        "it swings where it presses to the law's stiffest point",
        "stability of the contact mode at the law's largest slope",
    ): lambda study: read_contact(study, 0),
    Criterion(
        "growth where the law is stiffest, echoes one tick late", "1/s", "below", 0.0,
        "the loop tolerates a processor that needs one more tick",
        "with one more tick of latency it swings where the law is stiffest",
        _OURS,
    ): lambda study: read_contact(study, 1),
    Criterion(
        "growth at rest, worst parameters", "1/s", "below", 0.0,
        "it stays stable for all parameters in their ranges",
        "some parameters in their ranges make it unstable",
        "stability over the ranges of all parameters",
    ): read_worst_case("robustness"),
    Criterion(
        "growth before an obstacle, worst parameters", "1/s", "below", 0.0,
        "it comes to rest before an obstacle for all parameters in their ranges",
        "some parameters in their ranges make it swing where the law is stiffest",
        "stability over the ranges of all parameters",
    ): read_worst_case("contact_robustness"),
    Criterion(
        "places where the robot can jam", "", "at most", 0.0,
        "it rests near the follow distance only",
        "it can come to rest away from the source",
        "no such place is wanted; away means outside the goal of a run",
    ): read_jams,
    Criterion(
        "offset from the follow point at rest", "m", "at most", 0.1,
        "it rests at the follow distance",
        "obstacles, or the source's own body, push it off that distance",
        _OURS,
    ): read_offset,
    Criterion(
        "start certified", YES_OR_NO, "at least", 1.0,
        "in the certificate's model, P touches nothing from this scenario's start",
        "energy alone does not exclude a contact from this start",
        "energy certificate",
    ): read_start,
    Criterion(
        "largest power of the velocity term", "of D_r", "at most", 1.0,
        "the velocity term never gives more energy than D_r takes",
        "the velocity term can drive the motion",
        "passivity",
    ): read_passive,
    Criterion(
        "collisions from certified starts", "", "at most", 0.0,
        "simulation does not contradict the certificate",
        "simulation contradicts the certificate",
        "a proof has no exceptions",
    ): read_trials,
    Criterion(
        "error of the linear prediction of a small step", "% off", "at most", 2.0,
        "frequency and damping agree with the nonlinear simulation",
        "the corner of the velocity term at rest, which no linear model has, has an "
        "effect",
        "2 % in frequency and damping, with exact sensors",
    ): read_prediction,
    Criterion(
        "difference between two computations of the model", "", "at most", 1e-8,
        "two independent computations of the linear model agree",
        "two computations of the linear model differ",
        "rounding",
    ): read_routes,
}  # fmt: skip
