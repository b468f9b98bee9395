"""Part of the stability report about the adaptation of gains on a route."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from analysis.report.criterion import Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Column, Content, Figure, Table, number
from analysis.routes.adaptation_stability import (
    AdaptationStability,
    adaptation_stability,
)
from analysis.routes.trajectory_plots import (
    plot_adaptation,
)
from analysis.stability.law_analysis import Part, Study


@dataclass(frozen=True)
class Adaptation:
    """Stability of the adaptation of gains, and the stiffness that it reaches in a jam.

    In a jam, a wall holds the robot while the target moves on.
    """

    stability: AdaptationStability
    jam_share: float
    """Stiffness K at the end of a jam, divided by the largest stable stiffness. NaN if
    that limit is unknown."""


def _adaptation(study: Study) -> Adaptation:
    stability = adaptation_stability(study.scenario)
    found = study.found.get("gain_bounds")
    bound = found.bounds.stable_today_n_m[0] if found else math.nan
    learned = stability.jam.end_n_m[1]
    return Adaptation(stability, math.inf if bound <= 0.0 else learned / bound)


def _adaptation_document(data: Adaptation) -> dict[str, Any]:
    found = data.stability
    run = found.lyapunov
    return {
        **pick(found, "rule", "rate", "reference_poles", "jam", "margin", "bounded"),
        "reference_rad_s": found.reference[0],
        "reference_damping_ratio": found.reference[1],
        "reference_poles_z": found.held_poles,
        "lyapunov": run
        and {
            **pick(run, "falls", "largest_rise", "sampled_rise"),
            "left": run.continuous[-1],
            "sampled_left": run.sampled[-1],
        },
        "drift": pick(
            found.drift, "push_n", "time_s", "gradient_n_m", "simulated_n_m",
            "limited_n_m",
        ),
        "critical_rate": found.critical.rate,
        "critical_amplitude_m": found.critical.amplitude_m,
        "critical_products": {
            f"{each.amplitude_m:g}": each.product for each in found.products
        },
        "jam_share": data.jam_share,
    }  # fmt: skip


def _show_adaptation(data: Adaptation) -> list[Content]:
    found = data.stability
    frequency, ratio = found.reference
    drift, jam = found.drift, found.jam
    return [
        (
            f"The reference has w_n = {number(frequency)} rad/s, xi = {number(ratio)}, "
            "the poles "
            f"{', '.join(number(_plain(pole)) for pole in found.reference_poles)} "
            "rad/s, and over a tick the poles "
            f"{', '.join(number(_plain(z)) for z in found.held_poles)}. The sampled "
            "reference is exact. It has the nominal gains. On free floor, there is "
            "therefore nothing to learn: the law learns only because of contacts, "
            "limits and motors."
        ),
        _of_lyapunov(found),
        f"The adaptation rate is gamma = {number(found.rate)}. Without limits, K and "
        f"D run away at rates of {number(found.critical.rate)} or more, which is "
        f"{number(found.margin)} times the current rate, if the target swings by "
        f"{number(found.critical.amplitude_m)} m. With a lag of this size, the target "
        "pulls P through a contact. gamma_crit a\u00b2 is "
        + ", ".join(
            f"{number(each.product)} at {number(each.amplitude_m)} m"
            for each in found.products
        )
        + ".",
        Table(
            [Column("time", "s"), "gradient, closed form", "without limits", "as set"],
            [
                [float(time), *values]
                for time, *values in zip(
                    drift.time_s,
                    drift.gradient_n_m,
                    drift.simulated_n_m,
                    drift.limited_n_m,
                    strict=True,
                )
            ],
            f"Drift of K (N/m) under a push of {number(drift.push_n)} N that the "
            "reference does not include: closed form (K_0\u2074 + 4 gamma F\u00b2 "
            "t)^(1/4), and simulation without limits and as set",
        ),
        Table(
            [
                "",
                f"after {number(jam.jam_s)} s of jam",
                f"{number(jam.after_s)} s later",
            ],
            [
                [text, jam.end_n_m[k], jam.left_n_m[k]]
                for k, text in enumerate(("without limits", "as set"))
            ],
            "Jam: K (N/m) while a wall holds P and the target moves on, and after the "
            "wall is gone; infinite means that the loop is unstable with the gains "
            "that it learned",
        ),
        "The limits of `projected` keep K and D within bounds. They do not bring K and "
        "D back."
        if found.bounded
        else "Nothing bounds K and D; set `projected` to bound them.",
        Figure(
            lambda: plot_adaptation(found), "Lyapunov function, and drift under a push."
        ),
    ]


def _plain(pole: complex) -> complex:
    return pole if abs(pole.imag) > 1e-9 else pole.real


def _of_lyapunov(data: AdaptationStability) -> str:
    run = data.lyapunov
    if run is None:
        return (
            f"The rule {data.rule!r} is a gradient rule: no Lyapunov function is "
            "known for it, and it is stable only below a certain rate."
        )
    return (
        "V = w_n\u00b2 |e|\u00b2/2 + |e_v|\u00b2/2 + (\u0394K\u00b2 + "
        "\u0394D\u00b2)/(2 gamma), starts from gains that are half of the wanted "
        "gains, and "
        + ("falls all the time" if run.falls else "rises")
        + f" in continuous time: its largest rise is {number(run.largest_rise)} of "
        "its initial value. In the sampled loop with motors it may rise by "
        f"{number(run.sampled_rise)} per tick. After one minute "
        f"{number(float(run.continuous[-1]))} of it remain in continuous time, "
        f"and {number(float(run.sampled[-1]))} in the sampled loop. V does not "
        "include contacts: they act as a disturbance."
    )


def _lyapunov_rise(data: Adaptation) -> Reading:
    run = data.stability.lyapunov
    return run.largest_rise if run else "no Lyapunov function is known for the rule"


ADAPTATION = Part[Adaptation](
    "adaptation",
    "Adaptation",
    _adaptation,
    _show_adaptation,
    criteria=(
        Criterion(
            "rise of the Lyapunov function", "", "at most", 1e-9,
            "without contacts, the rule's Lyapunov function falls all the time",
            "the rule's Lyapunov function rises",
            "rounding",
            _lyapunov_rise,
        ),
        Criterion(
            "critical adaptation rate over the current rate", "", "above", 1.0,
            "K and D do not run away, even if the target leads by the largest lag",
            "K and D run away if the target leads by the largest lag",
            "simulated without contacts and without limits",
            lambda data: data.stability.margin,
        ),
        Criterion(
            "stiffness learned in a jam, share of the stable limit", "", "below", 1.0,
            "it stays stable with the stiffness that it learns behind a wall",
            "the stiffness that it learns behind a wall makes it unstable when the "
            "wall is gone",
            "after 90 s of jam the target rests; with the limits of the scenario",
            lambda data: data.jam_share,
        ),
    ),
    document=_adaptation_document,
)  # fmt: skip
