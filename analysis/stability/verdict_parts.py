"""The last part of the stability report: numbers against thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from analysis.runs.html_page import Cell, table
from analysis.stability.contact_mode import contact_spectral_radius
from analysis.stability.loop_uncertainty import law_stiffness
from analysis.stability.margin_parts import Margins, least_damped
from analysis.stability.stability import Part, Study
from analysis.stability.verdicts import Criterion, Verdict, judge
from systems.signals import FRAME_PERIOD_S

__all__ = ["verdict_parts"]

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
_SENSITIVITY = "usual: M_s of 1.2 to 2.0 (Astrom and Murray)"
_OURS = "ours"

#: A number, or why there is none.
Reading = float | str


def _at(study: Study) -> Any:
    return study.need("equilibria").at


def _decay(study: Study) -> Reading:
    return float(_at(study).eigenvalues.real.max())


def _damping(study: Study) -> Reading:
    pole = least_damped(_at(study).eigenvalues)
    return -pole.real / abs(pole)


def _margin(name: str, at: str) -> Callable[[Study], Reading]:
    def read(study: Study) -> Reading:
        margins: Margins | None = study.found.get("margins")
        loop = margins and margins.implemented_at(at, "along")
        if not loop:
            return f"there is no loop along the line, cut at the {at}"
        return float(loop.disk.alpha if name == "disk" else getattr(loop, name))

    return read


def _worst_margin(name: str, *, largest: bool) -> Callable[[Study], Reading]:
    """Of all cuts and directions."""

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


def _delay(study: Study) -> Reading:
    data = study.found.get("sampled")
    if not data or not data.margins:
        return "delay margins were not computed"
    return float(min(margin.delay_s for margin in data.margins))


def _cycle(study: Study) -> Reading:
    data = study.found.get("burst_cycle")
    if not data:
        return "the burst cycle was not computed"
    today = next(cycle for cycle in data.cycles if cycle.hold == data.today)
    return today.largest


def _jams(study: Study) -> Reading:
    points = study.need("equilibria")
    band = study.scenario.stop.following_band_m
    return float(sum(p.stable and p.offset_m > band for p in points.search.points))


def _offset(study: Study) -> Reading:
    return round(abs(float(_at(study).offset_m)), 9)


def _contact(study: Study, ticks: int) -> Reading:
    scenario = study.scenario
    stiffness = law_stiffness(scenario)
    if stiffness <= 0.0:
        return "the law does not push off obstacles"
    total = scenario.attraction.stiffness_n_m + stiffness
    return _growth(contact_spectral_radius(scenario, total, latency_ticks=ticks))


def _growth(radius: float) -> float:
    """ln(|z|)/T of the sampled loop, 1/s."""
    return math.log(radius) / FRAME_PERIOD_S


def _worst_case(key: str) -> Callable[[Study], Reading]:
    def read(study: Study) -> Reading:
        data = study.found.get(key)
        return _growth(data.cloud.worst_radius) if data else "it was not computed"

    return read


def _passive(study: Study) -> Reading:
    data = study.found.get("energy_balance")
    if not data:
        return "the law has no radial force"
    passivity = data.passivity
    if passivity.attraction_damping_n_s_m == 0.0:
        return "there is no damping to compare with"
    share = passivity.largest_injection_n_s_m / passivity.attraction_damping_n_s_m
    return float(share)


def _barrier(study: Study) -> Reading:
    data = study.found.get("certificates")
    if not data:
        return "there is no energy certificate"
    certificate = data[0].certificate
    return certificate.contact_energy_j / certificate.model.top_kinetic_energy_j


def _trials(study: Study) -> Reading:
    data = study.found.get("certificates")
    return float(data[0].trials.inside_collisions) if data else "no certificate"


def _routes(study: Study) -> Reading:
    data = study.found.get("linear_models")
    return data.routes.matrix_difference if data else "no linear models"


def _prediction(study: Study) -> Reading:
    data = study.found.get("step")
    if not data:
        return "no step was simulated"
    return 100.0 * max(abs(data.frequency_error), abs(data.damping_error))


_CRITERIA: tuple[tuple[Criterion, Callable[[Study], Reading]], ...] = (
    (
        Criterion(
            "growth at rest", "1/s", "below", 0.0,
            "small deviations from the follow point die out",
            "small deviations from the follow point grow",
            "stability",
        ),
        _decay,
    ),
    (
        Criterion(
            "damping ratio at rest", "", "at least", 0.4,
            "overshoots are small",
            "it overshoots and swings for several cycles",
            "usual: 0.4 to 0.8 (Astrom and Murray)",
        ),
        _damping,
    ),
    (
        Criterion(
            "least phase margin", "deg", "at least", 45.0,
            "every cut loop stands the usual extra phase lag",
            "a small extra phase lag makes it oscillate",
            _MARGINS,
        ),
        _worst_margin("phase_margin_deg", largest=False),
    ),
    (
        Criterion(
            "least gain margin", "dB", "at least", 6.0,
            "gains may double",
            "a gain that is less than twice as large makes it oscillate",
            _MARGINS,
        ),
        _worst_margin("gain_margin_db", largest=False),
    ),
    (
        Criterion(
            "largest sensitivity peak", "", "at most", 2.0,
            "disturbances are hardly amplified",
            "disturbances near the crossover are amplified more than twice",
            _SENSITIVITY,
        ),
        _worst_margin("sensitivity_peak", largest=True),
    ),
    (
        Criterion(
            "least disk margin", "", "at least", 2.0 / 3.0,
            "gain and phase may be off at once, by 6 dB and 37 deg",
            "gain and phase that are off at once make it oscillate early",
            "alpha = 2/3: 6 dB either way (Seiler, Packard and Gahinet 2020)",
        ),
        _worst_margin("disk", largest=False),
    ),
    (
        Criterion(
            "least delay margin", "s", "at least", 0.1,
            "four more ticks of delay do no harm",
            "less than four more ticks of delay make it oscillate",
            "ours: four ticks",
        ),
        _delay,
    ),
    (
        Criterion(
            "left after a burst cycle", "", "below", 1.0,
            "it settles although the source is silent most of the time",
            "it swings ever farther because the source is silent most of the time",
            "stability over a cycle of the sound",
        ),
        _cycle,
    ),
    (
        Criterion(
            "growth where the law is stiffest", "1/s", "below", 0.0,
            "it comes to rest however hard it is pressed against an obstacle",
            "pressed to where the law is stiffest, it swings",
            "stability of the contact mode at the law's largest slope",
        ),
        lambda study: _contact(study, 0),
    ),
    (
        Criterion(
            "the same with echoes a tick late", "1/s", "below", 0.0,
            "a processor may need one tick more",
            "with one more tick of latency it swings where the law is stiffest",
            _OURS,
        ),
        lambda study: _contact(study, 1),
    ),
    (
        Criterion(
            "worst case at rest", "1/s", "below", 0.0,
            "it stays stable with all parameters off",
            "parameters that are off make it unstable",
            "stability over the box of parameters",
        ),
        _worst_case("robustness"),
    ),
    (
        Criterion(
            "worst case before an obstacle", "1/s", "below", 0.0,
            "it comes to rest before an obstacle with all parameters off",
            "parameters that are off make it swing where the law is stiffest",
            "stability over the box of parameters",
        ),
        _worst_case("contact_robustness"),
    ),
    (
        Criterion(
            "places to jam", "", "at most", 0.0,
            "it rests near the follow distance only",
            "it can come to rest away from the source",
            "none is wanted; away: beyond `stop.following_band_m`",
        ),
        _jams,
    ),
    (
        Criterion(
            "offset at rest", "m", "at most", 0.1,
            "it rests at the follow distance",
            "what it avoids, the source's own body too, pushes it off that distance",
            _OURS,
        ),
        _offset,
    ),
    (
        Criterion(
            "energy at contact over kinetic energy", "", "at least", 1.0,
            "a start at top speed far from obstacles cannot hit one",
            "at top speed it can break through to contact",
            "energy certificate",
        ),
        _barrier,
    ),
    (
        Criterion(
            "power that the velocity term gives", "of D_r", "at most", 1.0,
            "the velocity term never gives more energy than D_r takes",
            "the velocity term can drive the motion",
            "passivity",
        ),
        _passive,
    ),
    (
        Criterion(
            "collisions from certified starts", "", "at most", 0.0,
            "simulation does not contradict the certificate",
            "simulation contradicts the certificate",
            "a proof has no exceptions",
        ),
        _trials,
    ),
    (
        Criterion(
            "linear prediction of a small step", "% off", "at most", 2.0,
            "frequency and damping are those of the nonlinear simulation",
            "the velocity term's corner at rest, which no linear model has, shows",
            "2 % in frequency and damping, exact sensors",
        ),
        _prediction,
    ),
    (
        Criterion(
            "difference of two routes to the model", "", "at most", 1e-8,
            "two independent computations of the linear model agree",
            "two computations of the linear model differ",
            "rounding",
        ),
        _routes,
    ),
)  # fmt: skip


def verdict_parts() -> tuple[Part, ...]:
    """All criteria, of what earlier parts found."""
    return (Part("verdicts", "Verdicts", _verdicts, _render, fresh=True),)


def _verdicts(study: Study) -> tuple[Verdict, ...]:
    verdicts = []
    for criterion, read in _CRITERIA:
        value = read(study)
        if isinstance(value, str):
            verdicts.append(judge(criterion, None, value))
        elif math.isnan(value):
            verdicts.append(judge(criterion, None, "there is no such number"))
        else:
            verdicts.append(judge(criterion, value))
    return tuple(verdicts)


def _render(data: tuple[Verdict, ...], name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [v.name, v.value, v.threshold, v.verdict, v.text, v.source] for v in data
    ]
    headings = [
        "criterion",
        "value",
        "threshold",
        "verdict",
        "in plain words",
        "source",
    ]
    return [table(headings, rows)]
