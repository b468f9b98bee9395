"""Parts of the stability report for a robot on a route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from analysis.linear.loop_margins import LoopMargins
from analysis.models.linear_models import LinearModel
from analysis.reporting.html_page import (
    Cell,
    bullets,
    figure_html,
    number,
    paragraph,
    table,
)
from analysis.stability.law_analysis import Part, Study
from analysis.trajectory.adaptation_stability import (
    AdaptationStability,
    adaptation_stability,
)
from analysis.trajectory.chain_run import (
    BrakedChain,
    ChainRun,
    brake_chain,
    shake_chain,
)
from analysis.trajectory.frozen_gains import (
    WELL_DAMPED,
    FrozenPoint,
    GainBounds,
    frozen_gains,
    gain_bounds,
)
from analysis.trajectory.robot_chain import ROBOTS, RobotChain, robot_chain
from analysis.trajectory.trajectory_plots import (
    plot_adaptation,
    plot_braked_chains,
    plot_chain,
    plot_frozen_poles,
    plot_gain_bounds,
)

#: Fields of ``LoopMargins`` that the JSON document contains.
_MARGINS = (
    "stable", "gain_margin_db", "phase_margin_deg", "delay_margin_s",
    "crossover_rad_s", "sensitivity_peak",
)  # fmt: skip


@dataclass(frozen=True)
class ChainStudy:
    """Frequency responses of a chain of robots, and simulations of the same chain.

    In a chain, each robot follows the robot in front of it.
    """

    chain: RobotChain
    runs: tuple[ChainRun, ...]
    braked: tuple[BrakedChain, ...]


def route_parts(left_out: Sequence[str]) -> tuple[Part, ...]:
    """Returns the parts for a robot on a route, and a list of parts that do not apply.

    The parts are about these subjects:

    - Poles and margins with frozen gains.
    - Bounds of stiffness and damping.
    - Adaptation of the gains.
    - Chains of robots that follow one another.

    Args:
        left_out: Titles of the parts for a robot that follows a sound. They do not
            apply to a robot on a route.

    Returns:
        Five parts, in the order of the report. The last one lists ``left_out``.
    """
    titles = tuple(left_out)
    return (
        Part(
            "frozen_gains",
            "Frozen gains",
            lambda study: frozen_gains(study.scenario),
            _render_frozen,
            document=_frozen_document,
            models=_frozen_models,
        ),
        Part(
            "gain_bounds",
            "Bounds of stiffness and damping",
            lambda study: gain_bounds(study.scenario),
            _render_bounds,
            document=lambda data: {
                "gain_bounds": {**vars(data), "mass": data.mass._asdict()}
            },
        ),
        Part(
            "adaptation",
            "Adaptation",
            lambda study: adaptation_stability(study.scenario),
            _render_adaptation,
            document=_adaptation_document,
        ),
        Part(
            "robot_chain",
            "Robots that follow one another",
            _chain,
            _render_chain,
            document=_chain_document,
        ),
        Part(
            "left_out",
            "Parts that do not apply",
            lambda study: titles,
            _render_left_out,
        ),
    )


def _frozen_models(data: Sequence[FrozenPoint]) -> tuple[LinearModel, ...]:
    return tuple(
        replace(point.model, name=f"frozen gains {point.at.name}") for point in data
    )


def _frozen_document(data: Sequence[FrozenPoint]) -> dict[str, Any]:
    return {
        "frozen_gains": [
            {
                "at": point.at,
                "stiffness_n_m": point.stiffness_n_m,
                "damping_n_s_m": point.damping_n_s_m,
                "poles": point.model.s_poles,
                "growth_per_s": point.model.growth_per_s,
                "damping_ratio": point.model.damping_ratio,
                "margins": {
                    axis: {name: getattr(margins, name) for name in _MARGINS}
                    for axis, margins in point.margins.items()
                },
            }
            for point in data
        ]
    }


def _render_frozen(data: Sequence[FrozenPoint], name: str) -> list[str]:
    poles: list[list[Cell]] = [
        [
            point.at.name,
            point.stiffness_n_m,
            point.damping_n_s_m,
            ", ".join(_poles_of(point)),
            point.model.growth_per_s,
            point.model.damping_ratio,
        ]
        for point in data
    ]
    margins: list[list[Cell]] = [
        [point.at.name, axis, *_margin_cells(each)]
        for point in data
        for axis, each in point.margins.items()
    ]
    return [
        paragraph(
            "The models describe the loop about P's target with constant gains: law, "
            "wheel command, plant and odometry as built, each linearized, over one "
            "tick. On the route the robot drives at the target's speed. In contact a "
            "wall at rest is across its path; K and D act along the path. The safety "
            "filter does not intervene, and no limit is reached."
        ),
        table(
            ["place", "K (N/m)", "D (N s/m)", "poles ln(z)/T (rad/s)", "growth (1/s)",
             "damping ratio"],
            poles,
        ),
        table(
            ["place", "direction", "gain (dB)", "phase (deg)", "delay (s)", "M_s"],
            margins,
            caption="Margins of the loop cut at the acceleration",
        ),
        figure_html(plot_frozen_poles(data), name, "Poles with frozen gains."),
    ]  # fmt: skip


def _poles_of(point: FrozenPoint) -> list[str]:
    """Returns the poles as texts, slowest first; of a conjugate pair only one pole."""
    poles = sorted(point.model.s_poles.tolist(), key=lambda pole: -pole.real)
    shown = [pole for pole in poles if pole.imag >= -1e-9]
    return [number(p if abs(p.imag) > 1e-9 else p.real) for p in shown]


def _margin_cells(each: LoopMargins) -> list[Cell]:
    return [
        each.gain_margin_db,
        each.phase_margin_deg,
        each.delay_margin_s,
        each.sensitivity_peak,
    ]


def _render_bounds(data: GainBounds, name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [
            f"{late} tick{'s' * (late > 1)} late" if late else "as built",
            data.stable_today_n_m[k],
            data.closed_form_n_m[k],
            data.damped_today_n_m[k],
        ]
        for k, late in enumerate(data.late_ticks)
    ]
    stiffness, damping = data.today["target"]
    contacts = "any number of" if math.isinf(data.contacts) else f"{data.contacts:g}"
    return [
        paragraph(
            f"The bounds are for D = {number(damping)} N s/m (K is set to "
            f"{number(stiffness)} N/m), a motor lag of "
            f"{number(data.mass.motor_lag_s)} s and ticks of "
            f"{number(data.mass.tick_s * 1e3)} ms. They come from bisection on the "
            "one-period matrix of the blocks, and from the closed form that is used "
            "for warnings before a run."
        ),
        table(
            ["position that springs act on", "stable below K (N/m)", "closed form",
             f"damping ratio {WELL_DAMPED:g} up to K (N/m)"],
            rows,
        ),
        paragraph(
            "Dampers act on the velocity of the virtual mass. Together they may reach "
            f"{number(data.most_damping_n_s_m)} N s/m; 2 M/T is "
            f"{number(data.closed_damping_n_s_m)}. Therefore {contacts} contacts may "
            "act at once with full damping: combine a scan of more beams into objects "
            "first."
        ),
        figure_html(plot_gain_bounds(data), name, "Bounds of K over D."),
    ]  # fmt: skip


def _adaptation_document(data: AdaptationStability) -> dict[str, Any]:
    run = data.lyapunov
    return {
        "adaptation": {
            "rule": data.rule,
            "rate": data.rate,
            "reference_rad_s": data.reference[0],
            "reference_damping_ratio": data.reference[1],
            "reference_poles": data.reference_poles,
            "reference_poles_z": data.held_poles,
            "lyapunov": run
            and {
                "falls": run.falls,
                "largest_rise": run.largest_rise,
                "sampled_rise": run.sampled_rise,
                "left": float(run.continuous[-1]),
                "sampled_left": float(run.sampled[-1]),
            },
            "drift": {
                name: getattr(data.drift, name)
                for name in (
                    "push_n", "time_s", "gradient_n_m", "simulated_n_m", "limited_n_m"
                )
            },
            "jam": data.jam,
            "critical_rate": data.critical.rate,
            "critical_amplitude_m": data.critical.amplitude_m,
            "critical_products": {
                f"{each.amplitude_m:g}": each.product for each in data.products
            },
            "margin": data.margin,
            "bounded": data.bounded,
        }
    }  # fmt: skip


def _render_adaptation(data: AdaptationStability, name: str) -> list[str]:
    frequency, ratio = data.reference
    return [
        paragraph(
            f"The reference has w_n = {number(frequency)} rad/s, xi = "
            f"{number(ratio)}, the poles "
            f"{', '.join(number(_plain(pole)) for pole in data.reference_poles)} "
            "rad/s, and over a tick the poles "
            f"{', '.join(number(_plain(z)) for z in data.held_poles)}. The sampled "
            "reference is exact. It has the nominal gains, so that there is nothing to "
            "learn on free floor: contacts, limits and motors cause all that the law "
            "learns."
        ),
        paragraph(_of_lyapunov(data)),
        paragraph(
            f"The adaptation rate is gamma = {number(data.rate)}. Without limits K "
            f"and D run away at rates from {number(data.critical.rate)} on, "
            f"{number(data.margin)} times the current rate, if the target swings by "
            f"{number(data.critical.amplitude_m)} m; this is the lag at which the "
            "target pulls P through a contact. gamma_crit a\u00b2 is "
            + ", ".join(
                f"{number(each.product)} at {number(each.amplitude_m)} m"
                for each in data.products
            )
            + "."
        ),
        table(
            ["time (s)", "gradient, closed form", "without limits", "as set"],
            [
                [float(time), *values]
                for time, *values in zip(
                    data.drift.time_s,
                    data.drift.gradient_n_m,
                    data.drift.simulated_n_m,
                    data.drift.limited_n_m,
                    strict=True,
                )
            ],
            caption=
                f"Drift of K (N/m) under a push of {number(data.drift.push_n)} N that "
                "the reference does not include: closed form (K_0\u2074 + 4 gamma "
                "F\u00b2 t)^(1/4), and simulation without limits and as set"
            ,
        ),
        table(
            ["", f"after {number(data.jam.jam_s)} s of jam",
             f"{number(data.jam.after_s)} s later"],
            [
                [text, data.jam.end_n_m[k], data.jam.left_n_m[k]]
                for k, text in enumerate(("without limits", "as set"))
            ],
            caption=
                "Jam: K (N/m) while a wall holds P and the target moves on, and after "
                "the wall is gone; infinite means that the loop is unstable with the "
                "gains that it learned"
            ,
        ),
        paragraph(
            "The limits of `projected` keep K and D within bounds. They do not bring K "
            "and D back."
            if data.bounded
            else "Nothing bounds K and D; set `projected` to bound them."
        ),
        figure_html(
            plot_adaptation(data), name, "Lyapunov function, and drift under a push."
        ),
    ]  # fmt: skip


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


def _chain(study: Study) -> ChainStudy:
    scenario = study.scenario
    chain = robot_chain(scenario)
    kinds = chain.peaks.items()
    return ChainStudy(
        chain,
        tuple(shake_chain(scenario, name, peak) for name, peak in kinds),
        tuple(
            brake_chain(
                scenario,
                name,
                feed_forward=peak.feed_forward,
                spacing_m=peak.spacing_m,
            )
            for name, peak in kinds
        ),
    )


def _chain_document(data: ChainStudy) -> dict[str, Any]:
    chain = data.chain
    return {
        "robot_chain": {
            "stiffness_n_m": chain.stiffness_n_m,
            "damping_n_s_m": chain.damping_n_s_m,
            "least_damping_n_s_m": chain.least_damping_n_s_m,
            "least_damping_in_contact_n_s_m": chain.least_damping_in_contact_n_s_m,
            "most_feed_forward": chain.most_feed_forward,
            "time_headway_s": chain.time_headway_s,
            "chains": [
                {
                    "name": name,
                    "feed_forward": peak.feed_forward,
                    "spacing_m": peak.spacing_m,
                    "peak": peak.peak,
                    "frequency_rad_s": peak.frequency_rad_s,
                    "grows": peak.grows,
                    "tail": {str(n): value for n, value in peak.tail.items()},
                    "simulated": run.simulated,
                    "predicted": run.predicted,
                    "difference": run.difference,
                    "least_gap_m": braked.least_gap_m,
                    "overshoot_m": braked.overshoot_m,
                }
                for (name, peak), run, braked in zip(
                    chain.peaks.items(), data.runs, data.braked, strict=True
                )
            ],
        }
    }


def _render_chain(data: ChainStudy, name: str) -> list[str]:
    chain = data.chain
    rows: list[list[Cell]] = [
        [
            kind,
            peak.spacing_m,
            peak.peak,
            *(peak.tail[n] for n in ROBOTS[1:]),
            run.difference,
            "grows" if peak.grows else "does not grow",
        ]
        for (kind, peak), run in zip(chain.peaks.items(), data.runs, strict=True)
    ]
    brakes: list[list[Cell]] = [
        [run.name, *(1e3 * value for value in run.overshoot_m.tolist())]
        for run in data.braked
    ]
    headings = ["chain", "spacing (m)", *(f"{n} robots" for n in ROBOTS)]
    pairs = range(1, len(data.braked[0].overshoot_m) + 1)
    return [
        paragraph(
            "Robots like this one drive on a line by the same law. The target of each "
            "robot is a place behind its predecessor, with feed-forward of the "
            "predecessor's velocity or without it. The object sensors are exact. In "
            "contact the zones of neighbors meet, and the neighbors push each other. "
            "The amplification is the amplitude of the last robot over the amplitude "
            "of the first robot, at the frequency where this ratio is largest. The "
            "safety filter does not intervene."
        ),
        table(
            [*headings, "error of simulation", "a disturbance"],
            rows,
            caption="Amplification from the first to the last robot",
        ),
        paragraph(_of_chain(chain)),
        table(
            ["chain", *(f"robots {k} and {k + 1}" for k in pairs)],
            brakes,
            caption="How far each gap falls below its final value, mm, when the first "
            "robot brakes from the target's speed to rest",
        ),
        figure_html(
            plot_chain(chain, data.runs),
            f"{name}-response",
            "Left: amplification by a pair of robots over frequency. Middle: eight "
            "robots at the frequency where their chain amplifies most, or at a "
            "robot's natural frequency if nothing grows. Right: a pair out of "
            "contact, over D.",
        ),
        figure_html(
            plot_braked_chains(data.braked),
            f"{name}-braked",
            "Gaps after the first robot has braked.",
        ),
    ]


def _of_chain(chain: RobotChain) -> str:
    growing = [name for name, peak in chain.peaks.items() if peak.grows]
    calm = [name for name in chain.peaks if name not in growing]
    text = ""
    if growing:
        text += (
            "A disturbance grows along the chain in these cases: "
            f"{'; '.join(growing)}. "
        )
    if calm:
        text += f"It does not grow in these cases: {'; '.join(calm)}. "
    text += (
        "Out of contact, with feed-forward of the predecessor's whole velocity, it "
        "grows for every D, because |G| is above 1 at low frequency. Without "
        f"feed-forward it does not grow at K = {number(chain.stiffness_n_m)} N/m if D "
        f"is at least {number(chain.least_damping_n_s_m)} N s/m (in contact at least "
        f"{number(chain.least_damping_in_contact_n_s_m)} N s/m), but then gaps grow "
        f"by D/K = {number(chain.time_headway_s)} s times the speed."
    )
    if chain.most_feed_forward >= 0.0:
        share = 100.0 * chain.most_feed_forward
        text += (
            f" Up to {number(share, 3)} % of the velocity may be fed forward without "
            "growth."
        )
    return text


def _render_left_out(data: Sequence[str], name: str) -> list[str]:
    return [
        paragraph(
            "The following parts do not apply, because they are about a robot that "
            "follows a sound: its follow distance, its tracker, its bursts and its "
            "law's push."
        ),
        bullets(data),
    ]
