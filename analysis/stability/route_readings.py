"""Criteria for a robot on a route, and functions that read their numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from analysis.stability.law_analysis import Study
from analysis.stability.verdict_readings import Reading
from analysis.stability.verdicts import Criterion
from analysis.trajectory.frozen_gains import WELL_DAMPED
from analysis.trajectory.route_loop import route_law
from systems.ranging.parameters import OBJECT_SLOTS

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
_CHAIN = "l2 string stability: no frequency is amplified; 1e-6 allows for rounding"
_OURS = "ours"


def _of(
    key: str, number: Callable[[Any], float | None], missing: str
) -> Callable[[Study], Reading]:
    """Returns a function that reads a number from the data of one part of the report.

    If the part has no data or no such number, that function returns ``missing``.
    """

    def read(study: Study) -> Reading:
        data = study.found.get(key)
        value = number(data) if data else None
        return missing if value is None else float(value)

    return read


def _frozen(number: Callable[[Any], float]) -> Callable[[Study], Reading]:
    return _of("frozen_gains", number, "frozen gains were not computed")


def _margin(name: str, *, largest: bool = False) -> Callable[[Study], Reading]:
    worst = max if largest else min
    return _frozen(
        lambda points: worst(
            getattr(margins, name)
            for point in points
            for margins in point.margins.values()
        )
    )


def _adaptation(number: Callable[[Any], float | None]) -> Callable[[Study], Reading]:
    return _of("adaptation", number, "nothing adapts, or the rule has no such number")


def _chain(name: str) -> Callable[[Study], Reading]:
    return _of(
        "robot_chain",
        lambda data: (
            max(data.chain.peaks[name].each) if name in data.chain.peaks else None
        ),
        "there are no contacts",
    )


def _springs(study: Study) -> Reading:
    """Returns the total stiffness near an obstacle relative to its stability limit.

    The total stiffness is the sum of the stiffness to the target and the stiffness of
    the contact. The limit is for the damping of the target alone and for positions that
    are one tick late.
    """
    bounds = study.found.get("gain_bounds")
    if not bounds:
        return "bounds were not computed"
    own = route_law(study.scenario)
    total = own.stiffness_n_m + own.contact_stiffness_n_m
    bound = bounds.stable_today_n_m[-1]
    return total / bound if bound > 0.0 else math.inf


def _jammed(study: Study) -> Reading:
    """Returns the stiffness at the end of a jam relative to its stability limit.

    In a jam, a wall holds the robot back while the target moves on, so that the law
    adapts its stiffness. The limit is for the damping of the target alone.
    """
    adaptation, bounds = study.found.get("adaptation"), study.found.get("gain_bounds")
    if not adaptation or not bounds:
        return "nothing adapts"
    bound = bounds.stable_today_n_m[0]
    return adaptation.jam.end_n_m[1] / bound if bound > 0.0 else math.inf


def _rise(data: Any) -> float | None:
    return data.lyapunov.largest_rise if data.lyapunov else None


#: Criteria for a robot on a route, each with the function that reads its number.
ROUTE_CRITERIA: dict[Criterion, Callable[[Study], Reading]] = {
    Criterion(
        "growth with frozen gains", "1/s", "below", 0.0,
        "small deviations die out, on the route, at rest and before a wall",
        "small deviations grow, on the route, at rest or before a wall",
        "stability",
    ): _frozen(lambda points: max(point.model.growth_per_s for point in points)),
    Criterion(
        "damping ratio out of contact", "", "at least", WELL_DAMPED,
        "it hardly overshoots its target",
        "it overshoots its target",
        "set by this project: 5 % of overshoot",
    ): _frozen(
        lambda points: min(
            p.model.damping_ratio for p in points if p.at.wall_m is None
        )
    ),
    Criterion(
        "least damping ratio", "", "at least", 0.4,
        "it does not swing before a wall either",
        "somewhere in the zone of a wall it swings for several cycles",
        "usual: 0.4 to 0.8 (Astrom and Murray)",
    ): _frozen(lambda points: min(point.model.damping_ratio for point in points)),
    Criterion(
        "least phase margin", "deg", "at least", 45.0,
        "the loop tolerates the usual extra phase lag or lead",
        "a small extra phase makes the loop oscillate",
        _MARGINS,
    ): _margin("phase_margin_deg"),
    Criterion(
        "least gain margin", "dB", "at least", 6.0,
        "gains may double, or fall to half",
        "a gain that is off by less than a factor of two makes it unstable",
        _MARGINS,
    ): _margin("gain_margin_db"),
    Criterion(
        "largest sensitivity peak", "", "at most", 2.0,
        "disturbances are hardly amplified",
        "disturbances near the crossover are amplified more than twice",
        "usual: M_s of 1.2 to 2.0 (Astrom and Murray)",
    ): _margin("sensitivity_peak", largest=True),
    Criterion(
        "least delay margin of the loop without sampling", "s", "at least", 0.1,
        "0.1 s more delay does no harm",
        "less than 0.1 s more delay makes it oscillate",
        "set by this project: four ticks of 25 ms; phase margin divided by crossover "
        "frequency",
    ): _margin("delay_margin_s"),
    Criterion(
        "sum of all springs, share of the stable limit", "", "below", 1.0,
        "target and contact together are soft enough, even if positions are one tick "
        "late",
        "target and contact together are too stiff if positions are one tick late",
        "stability, with the damping of the target alone",
    ): _springs,
    Criterion(
        "contacts that may act at once", "", "at least", float(OBJECT_SLOTS),
        "the dampers of all objects that it sees may act at once",
        "the dampers of several objects at once reverse the velocity at each tick",
        "D + n D_e < 2 M/T, with as many objects as the sensor can report",
    ): _of("gain_bounds", lambda data: data.contacts, "bounds were not computed"),
    Criterion(
        "rise of the Lyapunov function", "", "at most", 1e-9,
        "without contacts, the rule's Lyapunov function falls all the time",
        "the rule's Lyapunov function rises",
        "rounding",
    ): _adaptation(_rise),
    Criterion(
        "critical adaptation rate over the current rate", "", "above", 1.0,
        "K and D do not run away where the target leads by the largest lag",
        "K and D run away where the target leads by the largest lag",
        "simulated without contacts and without limits",
    ): _adaptation(lambda data: data.margin),
    Criterion(
        "stiffness learned in a jam, share of the stable limit", "", "below", 1.0,
        "it stays stable with the stiffness that it learns behind a wall",
        "the stiffness that it learns behind a wall makes it unstable when the wall "
        "is gone",
        "after 90 s of jam the target rests; with the limits of the scenario",
    ): _jammed,
    Criterion(
        "chain amplification with feed-forward", "", "at most", 1.0 + 1e-6,
        "no robot swings more than the first robot if each follows its predecessor",
        "a disturbance grows from robot to robot along the chain",
        _CHAIN,
    ): _chain("with feed-forward"),
    Criterion(
        "chain amplification without feed-forward", "", "at most", 1.0 + 1e-6,
        "no robot swings more than the first robot if each follows its predecessor",
        "a disturbance grows from robot to robot along the chain",
        _CHAIN,
    ): _chain("without feed-forward"),
    Criterion(
        "chain amplification in contact", "", "at most", 1.0 + 1e-6,
        "where zones of neighboring robots meet, no robot swings more than the first "
        "robot",
        "where zones of neighboring robots meet, a disturbance grows along the chain",
        _CHAIN,
    ): _chain("in contact, without feed-forward"),
}  # fmt: skip
