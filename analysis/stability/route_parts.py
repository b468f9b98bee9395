"""Parts of the stability report for a robot on a route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from analysis.loops.margin_results import LoopMargins
from analysis.report.criterion import Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Cell, Column, Content, Figure, Table, number
from analysis.routes.adaptation_stability import (
    AdaptationStability,
    adaptation_stability,
)
from analysis.routes.chain_run import (
    BrakedChain,
    ChainRun,
    brake_chain,
    shake_chain,
)
from analysis.routes.frozen_gains import (
    WELL_DAMPED,
    FrozenPoint,
    GainBounds,
    frozen_gains,
    gain_bounds,
)
from analysis.routes.robot_chain import ROBOTS, RobotChain, robot_chain
from analysis.routes.route_loop import route_law
from analysis.routes.trajectory_plots import (
    plot_adaptation,
    plot_braked_chains,
    plot_chain,
    plot_frozen_poles,
    plot_gain_bounds,
)
from analysis.stability.law_analysis import Part, Study
from analysis.stability.margin_parts import margin_criteria
from analysis.stability.requirements import REQUIRED
from systems.ranging.parameters import OBJECT_SLOTS

#: Fields of ``LoopMargins`` that the JSON document contains.
_MARGINS = (
    "stable", "gain_margin_db", "phase_margin_deg", "delay_margin_s",
    "crossover_rad_s", "sensitivity_peak",
)  # fmt: skip


def _frozen_document(data: Sequence[FrozenPoint]) -> list[dict[str, Any]]:
    return [
        {
            **pick(point, "at", "stiffness_n_m", "damping_n_s_m"),
            "poles": point.model.s_poles,
            **pick(point.model, "growth_per_s", "damping_ratio"),
            "margins": {
                axis: pick(margins, *_MARGINS)
                for axis, margins in point.margins.items()
            },
        }
        for point in data
    ]


def _show_frozen(data: Sequence[FrozenPoint]) -> list[Content]:
    return [
        ("The models describe the loop about P's target with constant gains: law, "
         "wheel command, plant and odometry as built, each linearized, over one tick. "
         "On the route the robot drives at the target's speed. In contact a wall at "
         "rest is across its path; K and D act along the path. The safety filter does "
         "not intervene, and no limit is reached."),
        Table.of(
            data,
            {
                "place": "at.name",
                Column("K", "N/m"): "stiffness_n_m",
                Column("D", "N s/m"): "damping_n_s_m",
                Column("poles ln(z)/T", "rad/s"): lambda at: ", ".join(_poles_of(at)),
                Column("growth", "1/s"): "model.growth_per_s",
                "damping ratio": "model.damping_ratio",
            },
        ),
        Table(
            [
                "place", "direction", Column("gain", "dB"), Column("phase", "deg"),
                Column("delay", "s"), "M_s",
            ],
            [
                [point.at.name, axis, each.gain_margin_db, each.phase_margin_deg,
                 each.delay_margin_s, each.sensitivity_peak]
                for point in data
                for axis, each in point.margins.items()
            ],
            "Margins of the loop cut at the acceleration",
        ),
        Figure(lambda: plot_frozen_poles(data), "Poles with frozen gains."),
    ]  # fmt: skip


def _poles_of(point: FrozenPoint) -> list[str]:
    """Returns the poles as texts, slowest first. A conjugate pair gives one text."""
    poles = sorted(point.model.s_poles.tolist(), key=lambda pole: -pole.real)
    shown = [pole for pole in poles if pole.imag >= -1e-9]
    return [number(p if abs(p.imag) > 1e-9 else p.real) for p in shown]


def _all_cuts(data: Sequence[FrozenPoint]) -> list[LoopMargins]:
    return [margins for point in data for margins in point.margins.values()]


FROZEN_GAINS = Part[Sequence[FrozenPoint]](
    "frozen_gains",
    "Frozen gains",
    lambda study: frozen_gains(study.scenario),
    _show_frozen,
    criteria=(
        Criterion(
            "growth with frozen gains", "1/s", "below", 0.0,
            "small deviations die out, on the route, at rest and before a wall",
            "small deviations grow, on the route, at rest or before a wall",
            "stability",
            lambda data: max(point.model.growth_per_s for point in data),
        ),
        Criterion(
            "damping ratio out of contact", "", "at least", WELL_DAMPED,
            "it hardly overshoots its target",
            "it overshoots its target",
            "set by this project: 5 % of overshoot",
            lambda data: min(
                point.model.damping_ratio for point in data if point.at.wall_m is None
            ),
        ),
        Criterion(
            "least damping ratio", "", "at least", 0.4,
            "it does not swing before a wall either",
            "somewhere in the zone of a wall it swings for several cycles",
            "usual: 0.4 to 0.8 (Astrom and Murray)",
            lambda data: min(point.model.damping_ratio for point in data),
        ),
        *margin_criteria(_all_cuts),
        Criterion(
            "least delay margin of the loop without sampling", "s", "at least",
            REQUIRED.delay_margin_s,
            "it tolerates more added delay than the threshold",
            "less added delay than the threshold makes it oscillate",
            "set by this project; phase margin divided by crossover frequency",
            lambda data: min(margins.delay_margin_s for margins in _all_cuts(data)),
        ),
    ),
    document=_frozen_document,
    models=lambda data: [
        replace(point.model, name=f"frozen gains {point.at.name}") for point in data
    ],
)  # fmt: skip


@dataclass(frozen=True)
class SpringBounds:
    """Bounds of stiffness and damping, and the stiffness of the scenario."""

    bounds: GainBounds
    total_stiffness_n_m: float
    """Sum of the stiffness to the target and the stiffness of a contact, N/m."""

    @property
    def share(self) -> float:
        """Total stiffness divided by the largest stable stiffness.

        This limit holds if the springs use positions that are one control period late.
        """
        bound = self.bounds.stable_today_n_m[-1]
        return self.total_stiffness_n_m / bound if bound > 0.0 else math.inf


def _bounds(study: Study) -> SpringBounds:
    own = route_law(study.scenario)
    return SpringBounds(
        gain_bounds(study.scenario), own.stiffness_n_m + own.contact_stiffness_n_m
    )


def _show_bounds(data: SpringBounds) -> list[Content]:
    bounds = data.bounds
    rows: list[list[Cell]] = [
        [
            f"{late} tick{'s' * (late > 1)} late" if late else "as built",
            bounds.stable_today_n_m[k],
            bounds.closed_form_n_m[k],
            bounds.damped_today_n_m[k],
        ]
        for k, late in enumerate(bounds.late_ticks)
    ]
    stiffness, damping = bounds.today["target"]
    contacts = (
        "any number of" if math.isinf(bounds.contacts) else f"{bounds.contacts:g}"
    )
    return [
        (
            f"The bounds are for D = {number(damping)} N s/m (K is set to "
            f"{number(stiffness)} N/m), a motor lag of "
            f"{number(bounds.mass.motor_lag_s)} s and ticks of "
            f"{number(bounds.mass.tick_s * 1e3)} ms. They come from bisection on the "
            "one-period matrix of the blocks, and from the closed form that is used "
            "for warnings before a run."
        ),
        Table(
            [
                "position that springs act on",
                Column("stable below K", "N/m"),
                "closed form",
                Column(f"damping ratio {WELL_DAMPED:g} up to K", "N/m"),
            ],
            rows,
        ),
        (
            "Dampers act on the velocity of the virtual mass. Together they may reach "
            f"{number(bounds.most_damping_n_s_m)} N s/m; 2 M/T is "
            f"{number(bounds.closed_damping_n_s_m)}. Therefore {contacts} contacts may "
            "act at once with full damping: combine a scan of more beams into objects "
            "first."
        ),
        Figure(lambda: plot_gain_bounds(bounds), "Bounds of K over D."),
    ]


GAIN_BOUNDS = Part[SpringBounds](
    "gain_bounds",
    "Bounds of stiffness and damping",
    _bounds,
    _show_bounds,
    criteria=(
        Criterion(
            "sum of all springs, share of the stable limit", "", "below", 1.0,
            "target and contact together are soft enough, even if positions are one "
            "tick late",
            "target and contact together are too stiff if positions are one tick late",
            "stability, with the damping of the target alone",
            lambda data: data.share,
        ),
        Criterion(
            "contacts that may act at once", "", "at least", float(OBJECT_SLOTS),
            "the dampers of all objects that it sees may act at once",
            "the dampers of several objects at once reverse the velocity at each tick",
            "D + n D_e < 2 M/T, with as many objects as the sensor can report",
            lambda data: data.bounds.contacts,
        ),
    ),
    document=lambda data: {
        **vars(data.bounds),
        "mass": data.bounds.mass._asdict(),
        "total_stiffness_n_m": data.total_stiffness_n_m,
    },
)  # fmt: skip


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


@dataclass(frozen=True)
class ChainStudy:
    """Frequency responses of a chain of robots, and simulations of the same chain."""

    chain: RobotChain
    runs: tuple[ChainRun, ...]
    braked: tuple[BrakedChain, ...]


def _chain(study: Study) -> ChainStudy:
    scenario = study.scenario
    chain = robot_chain(scenario)
    kinds = chain.peaks.items()
    return ChainStudy(
        chain,
        tuple(shake_chain(scenario, name, peak) for name, peak in kinds),
        tuple(
            brake_chain(
                scenario, name, feed_forward=peak.feed_forward, spacing_m=peak.spacing_m
            )
            for name, peak in kinds
        ),
    )


def _chain_document(data: ChainStudy) -> dict[str, Any]:
    chain = data.chain
    return {
        **pick(
            chain, "stiffness_n_m", "damping_n_s_m", "least_damping_n_s_m",
            "least_damping_in_contact_n_s_m", "most_feed_forward", "time_headway_s",
        ),
        "chains": [
            {
                "name": name,
                **pick(peak, "feed_forward", "spacing_m", "peak", "frequency_rad_s",
                       "grows", "tail"),
                **pick(run, "simulated", "predicted", "difference"),
                **pick(braked, "least_gap_m", "overshoot_m"),
            }
            for (name, peak), run, braked in zip(
                chain.peaks.items(), data.runs, data.braked, strict=True
            )
        ],
    }  # fmt: skip


def _show_chain(data: ChainStudy) -> list[Content]:
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
    lengths = [f"{n} robots" for n in ROBOTS]
    pairs = range(1, len(data.braked[0].overshoot_m) + 1)
    return [
        (
            "Robots like this one drive on a line by the same law. The target of each "
            "robot is a place behind its predecessor, with feed-forward of the "
            "predecessor's velocity or without it. The object sensors are exact. In "
            "contact the zones of neighbors meet, and the neighbors push each other. "
            "The amplification is the amplitude of the last robot over the amplitude "
            "of the first robot, at the frequency where this ratio is largest. The "
            "safety filter does not intervene."
        ),
        Table(
            [
                "chain",
                Column("spacing", "m"),
                *lengths,
                "error of simulation",
                "a disturbance",
            ],
            rows,
            "Amplification from the first to the last robot",
        ),
        _of_chain(chain),
        Table(
            ["chain", *(f"robots {k} and {k + 1}" for k in pairs)],
            brakes,
            "How far each gap falls below its final value, mm, when the first robot "
            "brakes from the target's speed to rest",
        ),
        Figure(
            lambda: plot_chain(chain, data.runs),
            "Left: amplification by a pair of robots over frequency. Middle: eight "
            "robots at the frequency where their chain amplifies most, or at a "
            "robot's natural frequency if nothing grows. Right: a pair out of "
            "contact, over D.",
        ),
        Figure(
            lambda: plot_braked_chains(data.braked),
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


def _amplification(name: str, where: str, good: str, bad: str) -> Criterion[ChainStudy]:
    def read(data: ChainStudy) -> Reading:
        peaks = data.chain.peaks
        return max(peaks[name].each) if name in peaks else "there are no contacts"

    return Criterion(
        f"chain amplification {where}", "", "at most", 1.0 + 1e-6, good, bad,
        "l2 string stability: no frequency is amplified; 1e-6 allows for rounding",
        read,
    )  # fmt: skip


ROBOT_CHAIN = Part[ChainStudy](
    "robot_chain",
    "Robots that follow one another",
    _chain,
    _show_chain,
    criteria=(
        *(
            _amplification(
                where,
                where,
                "no robot swings more than the first robot if each follows its "
                "predecessor",
                "a disturbance grows from robot to robot along the chain",
            )
            for where in ("with feed-forward", "without feed-forward")
        ),
        _amplification(
            "in contact, without feed-forward",
            "in contact",
            "where zones of neighboring robots meet, no robot swings more than the "
            "first robot",
            "where zones of neighboring robots meet, a disturbance grows along the "
            "chain",
        ),
    ),
    document=_chain_document,
)
