"""The last part of the stability report: numbers against thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable

from analysis.reporting.html_page import Cell, table
from analysis.stability.law_analysis import Part, Study
from analysis.stability.verdict_readings import (
    Reading,
    read_contact,
    read_cycle,
    read_damping,
    read_decay,
    read_delay,
    read_jams,
    read_offset,
    read_passive,
    read_prediction,
    read_routes,
    read_start,
    read_trials,
    read_worst_case,
    read_worst_margin,
)
from analysis.stability.verdicts import Criterion, Verdict, judge

__all__ = ["verdict_parts"]

_MARGINS = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
_SENSITIVITY = "usual: M_s of 1.2 to 2.0 (Astrom and Murray)"
_OURS = "ours"

_CRITERIA: tuple[tuple[Criterion, Callable[[Study], Reading]], ...] = (
    (
        Criterion(
            "growth at rest", "1/s", "below", 0.0,
            "small deviations from the follow point die out",
            "small deviations from the follow point grow",
            "stability",
        ),
        read_decay,
    ),
    (
        Criterion(
            "damping ratio at rest", "", "at least", 0.4,
            "overshoots are small",
            "it overshoots and swings for several cycles",
            "usual: 0.4 to 0.8 (Astrom and Murray)",
        ),
        read_damping,
    ),
    (
        Criterion(
            "least phase margin", "deg", "at least", 45.0,
            "every cut loop stands the usual extra phase, lag or lead",
            "a small extra phase makes it oscillate",
            _MARGINS,
        ),
        read_worst_margin("phase_margin_deg", largest=False),
    ),
    (
        Criterion(
            "least gain margin", "dB", "at least", 6.0,
            "gains may double, or fall to half",
            "a gain that is off by less than a factor of two, up or down, makes it "
            "unstable",
            _MARGINS,
        ),
        read_worst_margin("gain_margin_db", largest=False),
    ),
    (
        Criterion(
            "largest sensitivity peak", "", "at most", 2.0,
            "disturbances are hardly amplified",
            "disturbances near the crossover are amplified more than twice",
            _SENSITIVITY,
        ),
        read_worst_margin("sensitivity_peak", largest=True),
    ),
    (
        Criterion(
            "least disk margin", "", "at least", 2.0 / 3.0,
            "gain and phase may be off at once, by 6 dB and 37 deg",
            "gain and phase that are off at once make it oscillate early",
            "alpha = 2/3: 6 dB either way (Seiler, Packard and Gahinet 2020)",
        ),
        read_worst_margin("disk", largest=False),
    ),
    (
        Criterion(
            "least delay margin", "s", "at least", 0.1,
            "four more ticks of delay do no harm",
            "less than four more ticks of delay make it oscillate",
            "ours: four ticks",
        ),
        read_delay,
    ),
    (
        Criterion(
            "left after a burst cycle", "", "below", 1.0,
            "it settles although the source is silent most of the time",
            "it swings ever farther because the source is silent most of the time",
            "stability over a cycle of the sound",
        ),
        read_cycle,
    ),
    (
        Criterion(
            "growth where the law is stiffest", "1/s", "below", 0.0,
            "it comes to rest however hard it is pressed against an obstacle",
            "pressed to where the law is stiffest, it swings",
            "stability of the contact mode at the law's largest slope",
        ),
        lambda study: read_contact(study, 0),
    ),
    (
        Criterion(
            "the same with echoes a tick late", "1/s", "below", 0.0,
            "a processor may need one tick more",
            "with one more tick of latency it swings where the law is stiffest",
            _OURS,
        ),
        lambda study: read_contact(study, 1),
    ),
    (
        Criterion(
            "worst case at rest", "1/s", "below", 0.0,
            "it stays stable with all parameters off",
            "parameters that are off make it unstable",
            "stability over the box of parameters",
        ),
        read_worst_case("robustness"),
    ),
    (
        Criterion(
            "worst case before an obstacle", "1/s", "below", 0.0,
            "it comes to rest before an obstacle with all parameters off",
            "parameters that are off make it swing where the law is stiffest",
            "stability over the box of parameters",
        ),
        read_worst_case("contact_robustness"),
    ),
    (
        Criterion(
            "places to jam", "", "at most", 0.0,
            "it rests near the follow distance only",
            "it can come to rest away from the source",
            "none is wanted; away: outside the goal of a run",
        ),
        read_jams,
    ),
    (
        Criterion(
            "offset at rest", "m", "at most", 0.1,
            "it rests at the follow distance",
            "what it avoids, the source's own body too, pushes it off that distance",
            _OURS,
        ),
        read_offset,
    ),
    (
        Criterion(
            "start certified, 1 for yes", "", "at least", 1.0,
            "from this scenario's start P touches nothing, in the certificate's model",
            "energy alone does not exclude a contact from this start",
            "energy certificate",
        ),
        read_start,
    ),
    (
        Criterion(
            "power that the velocity term gives", "of D_r", "at most", 1.0,
            "the velocity term never gives more energy than D_r takes",
            "the velocity term can drive the motion",
            "passivity",
        ),
        read_passive,
    ),
    (
        Criterion(
            "collisions from certified starts", "", "at most", 0.0,
            "simulation does not contradict the certificate",
            "simulation contradicts the certificate",
            "a proof has no exceptions",
        ),
        read_trials,
    ),
    (
        Criterion(
            "linear prediction of a small step", "% off", "at most", 2.0,
            "frequency and damping are those of the nonlinear simulation",
            "the velocity term's corner at rest, which no linear model has, shows",
            "2 % in frequency and damping, exact sensors",
        ),
        read_prediction,
    ),
    (
        Criterion(
            "difference of two routes to the model", "", "at most", 1e-8,
            "two independent computations of the linear model agree",
            "two computations of the linear model differ",
            "rounding",
        ),
        read_routes,
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
