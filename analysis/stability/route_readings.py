"""What the verdicts ask of a robot on a route."""

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

__all__ = ["ROUTE_CRITERIA"]

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
_CHAIN = "l2 string stability: no frequency is amplified; 1e-6 is rounding"
_OURS = "ours"


def _of(
    key: str, number: Callable[[Any], float | None], missing: str
) -> Callable[[Study], Reading]:
    """Reads a number from a part's data; ``missing`` says why there is none."""

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
    """All springs in a zone, of those that are stable with the target's own damping."""
    bounds = study.found.get("gain_bounds")
    if not bounds:
        return "bounds were not computed"
    own = route_law(study.scenario)
    total = own.stiffness_n_m + own.contact_stiffness_n_m
    bound = bounds.stable_today_n_m[-1]
    return total / bound if bound > 0.0 else math.inf


def _jammed(study: Study) -> Reading:
    """K at the end of a jam, of what is stable with the target's own damping."""
    adaptation, bounds = study.found.get("adaptation"), study.found.get("gain_bounds")
    if not adaptation or not bounds:
        return "nothing adapts"
    bound = bounds.stable_today_n_m[0]
    return adaptation.jam.end_n_m[1] / bound if bound > 0.0 else math.inf


def _rise(data: Any) -> float | None:
    return data.lyapunov.largest_rise if data.lyapunov else None


#: What is asked, and what is read for it.
ROUTE_CRITERIA: dict[Criterion, Callable[[Study], Reading]] = {
    Criterion(
        "growth with frozen gains", "1/s", "below", 0.0,
        "small deviations die out, on the route, at rest and before a wall",
        "small deviations grow, on the route, at rest or before a wall",
        "stability",
    ): _frozen(lambda points: max(point.growth_per_s for point in points)),
    Criterion(
        "damping ratio out of contact", "", "at least", WELL_DAMPED,
        "it hardly overshoots its target",
        "it overshoots its target",
        "ours: 5 % of overshoot",
    ): _frozen(
        lambda points: min(p.damping_ratio for p in points if p.at.wall_m is None)
    ),
    Criterion(
        "least damping ratio", "", "at least", 0.4,
        "nor does it swing before a wall",
        "it swings for several cycles somewhere in a zone",
        "usual: 0.4 to 0.8 (Astrom and Murray)",
    ): _frozen(lambda points: min(point.damping_ratio for point in points)),
    Criterion(
        "least phase margin", "deg", "at least", 45.0,
        "the loop stands the usual extra phase, lag or lead",
        "a small extra phase makes it oscillate",
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
        "least delay margin", "s", "at least", 0.1,
        "four more ticks of delay do no harm",
        "less than four more ticks of delay make it oscillate",
        "ours: four ticks",
    ): _margin("delay_margin_s"),
    Criterion(
        "springs of the stable sum", "", "below", 1.0,
        "target and contact together are soft enough, even a tick late",
        "target and contact together are too stiff where places are a tick late",
        "stability, with the damping of the target alone",
    ): _springs,
    Criterion(
        "contacts that may be summed", "", "at least", float(OBJECT_SLOTS),
        "dampers of all objects that are seen may act at once",
        "dampers of some of the objects at once turn the velocity round at each tick",
        "D + n D_e < 2 M/T, with all that the object sensor may show",
    ): _of("gain_bounds", lambda data: data.contacts, "bounds were not computed"),
    Criterion(
        "rise of the Lyapunov function", "", "at most", 1e-9,
        "without contacts, the rule's Lyapunov function falls all the time",
        "the rule's Lyapunov function rises",
        "rounding",
    ): _adaptation(_rise),
    Criterion(
        "critical rate, of the current", "", "above", 1.0,
        "K and D do not run away where the target leads by the largest lag",
        "K and D run away where the target leads by the largest lag",
        "simulated, without contacts and cures",
    ): _adaptation(lambda data: data.margin),
    Criterion(
        "stiffness learnt, of the stable", "", "below", 1.0,
        "what it learns behind a wall leaves it stable",
        "what it learns behind a wall makes it unstable when that is gone",
        "90 s of jam, then the target rests; with the cures of the scenario",
    ): _jammed,
    Criterion(
        "growth along a chain, fed forward", "", "at most", 1.0 + 1e-6,
        "no robot swings more than the first where each follows the one before",
        "a disturbance grows from robot to robot",
        _CHAIN,
    ): _chain("with feed-forward"),
    Criterion(
        "the same without its velocity", "", "at most", 1.0 + 1e-6,
        "no robot swings more than the first where each follows the one before",
        "a disturbance grows from robot to robot",
        _CHAIN,
    ): _chain("without feed-forward"),
    Criterion(
        "the same in contact", "", "at most", 1.0 + 1e-6,
        "nor where their zones meet",
        "it does where their zones meet",
        _CHAIN,
    ): _chain("in contact, without"),
}  # fmt: skip
