"""Parts of the stability report: delay, bursts, sample period, gains, contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.design.attraction_search import (
    GainFigures,
    RecommendedGains,
    recommend_gains,
)
from analysis.linear.burst_cycle import (
    HOLDS,
    BurstCycle,
    BurstRun,
    burst_cycle,
    simulate_burst_cycle,
)
from analysis.linear.burst_gaps import GapChart, gap_chart
from analysis.linear.contact_mode import ContactLimits, contact_limits
from analysis.linear.delay_margin import DELAY_PLACES, DelayMargin, delay_margin
from analysis.linear.delayed_run import DelayCheck, check_delay_margin
from analysis.linear.root_locus import RootLocus, root_loci
from analysis.linear.sampled_stability import (
    ConditionCheck,
    PolesAgainstPeriod,
    StabilityChart,
    check_conditions,
    gain_chart,
    gain_delay_chart,
    poles_against_period,
)
from analysis.models.open_loops import DIRECTIONS
from analysis.models.operating_points import OperatingPoint
from analysis.reporting.html_page import Cell, figure_html, number, paragraph, table
from analysis.stability.chart_plots import (
    plot_chart,
    plot_contact_limits,
    plot_delay_check,
    plot_gap_chart,
    plot_poles_against_period,
    plot_root_loci,
)
from analysis.stability.law_analysis import Part, Study

#: Duration of the runs that check delay margins, s, in a short and in a full report.
_CHECK_S = (60.0, 300.0)
#: Number of simulated burst cycles in a short and in a full report.
_CYCLES = (20, 40)


@dataclass(frozen=True)
class SampledLoop:
    """Poles and delay margins of the sampled loop."""

    period_s: float
    poles: NDArray[np.complex128]
    """(n,) poles of the motion of the control point P, z plane."""
    margins: tuple[DelayMargin, ...]
    """Delay margins, one for each place of the delay and direction of motion."""
    check: DelayCheck | None
    """Simulations just below and just above the delay margin at the sensor. None if
    this margin is infinite."""

    @property
    def delay_margin_s(self) -> float:
        """Delay margin at the sensor for motion along the line to the source, s."""
        found = [m for m in self.margins if (m.at, m.direction) == ("sensor", "along")]
        return found[0].delay_s if found else float("inf")


@dataclass(frozen=True)
class BurstCycles:
    """Stability of the robot behind a source that sounds in bursts.

    A burst cycle consists of one burst of sound and the silence after it. In the
    silence, the robot holds the position of the target in one of several ways. There is
    one result for each way.
    """

    today: str
    """Hold of the scenario, ``tracker.hold``."""
    cycles: tuple[BurstCycle, ...]
    runs: tuple[BurstRun, ...]
    """One simulated run per entry of ``cycles``, in the same order."""
    gaps: GapChart
    """Largest multipliers over the duration of the silence."""


def sampling_parts(*, full: bool) -> tuple[Part, ...]:
    """Returns the parts about sampling, delays, the burst cycle, and contact.

    Args:
        full: Whether the simulations that check the results are long.

    Returns:
        Five parts, in the order of the report.
    """
    duration_s, cycles = _CHECK_S[full], _CYCLES[full]
    return (
        Part(
            "sampled",
            "Delay margins of the sampled loop",
            lambda study: _sampled(study, duration_s),
            _render_sampled,
            document=_document,
        ),
        Part(
            "burst_cycle",
            "Burst cycle",
            lambda study: _bursts(study, cycles),
            _render_bursts,
            document=_burst_document,
        ),
        Part(
            "root_loci",
            "Root loci",
            lambda study: root_loci(study.scenario),
            _render_loci,
        ),
        Part(
            "sampling",
            "Sample period, gains and delay",
            _sampling,
            _render_sampling,
            document=_sampling_document,
        ),
        Part(
            "contact_mode",
            "Contact mode",
            lambda study: contact_limits(study.scenario),
            _render_contact,
        ),
    )


def _sampled(study: Study, duration_s: float) -> SampledLoop:
    at: OperatingPoint = study.need("equilibria").at
    existing = {(m.at, m.direction) for m in study.need("margins").implemented}
    margins = tuple(
        delay_margin(at, place, direction)
        for place in DELAY_PLACES
        for direction in DIRECTIONS
        if (place, direction) in existing
    )
    check = None
    for margin in margins:
        if (margin.at, margin.direction) == ("sensor", "along") and np.isfinite(
            margin.delay_s
        ):
            check = check_delay_margin(at, duration_s=duration_s)
    return SampledLoop(at.loop.tick_s, at.motion.poles, margins, check)


def _document(data: SampledLoop) -> dict[str, Any]:
    return {
        "sampled": {
            "period_s": data.period_s,
            "poles": data.poles,
            "delay_margin_s": data.delay_margin_s,
            "delay_margins": data.margins,
            "check": data.check
            and {
                "below": _run_document(data.check.below),
                "above": _run_document(data.check.above),
                "confirmed": data.check.confirmed,
            },
        }
    }


def _run_document(run: Any) -> dict[str, float]:
    names = ("delay_s", "duration_s", "growth_per_s", "frequency_rad_s")
    return {name: getattr(run, name) for name in names}


def _render_sampled(data: SampledLoop, name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [m.at, m.direction, m.delay_s, m.delay_s / data.period_s, m.frequency_rad_s]
        for m in data.margins
    ]
    parts = [
        paragraph(
            "A delay margin is the delay that may be added before the loop "
            "oscillates, in fractions of a tick. It comes from bisection on the "
            "spectral radius of the one-period map with that delay. A delay at the "
            "sensor makes an estimate later than the tracker assumes; a delay at the "
            "wheels makes a command later."
        ),
        table(["late at", "motion", "delay (s)", "ticks", "rad/s"], rows),
    ]
    if data.check:
        runs = (("0.95", data.check.below), ("1.05", data.check.above))
        checks: list[list[Cell]] = [
            [share, run.delay_s, run.growth_per_s, run.frequency_rad_s]
            for share, run in runs
        ]
        parts.append(
            table(
                ["share of the margin", "delay (s)", "growth (1/s)", "rad/s"],
                checks,
                caption="Simulation of the diagram with that delay at the sensor, for "
                f"{data.check.below.duration_s:g} s after a small kick",
            )
        )
        parts.append(
            figure_html(
                plot_delay_check(data.check),
                name,
                "Runs just below the margin and just above it.",
            )
        )
    return parts


def _bursts(study: Study, count: int) -> BurstCycles:
    at: OperatingPoint = study.need("equilibria").at
    cycles = tuple(burst_cycle(study.scenario, hold, point=at) for hold in HOLDS)
    runs = tuple(simulate_burst_cycle(cycle, count) for cycle in cycles)
    gaps = gap_chart(study.scenario, point=at)
    return BurstCycles(study.scenario.follower.tracker.hold, cycles, runs, gaps)


def _burst_document(data: BurstCycles) -> dict[str, Any]:
    return {
        "burst_cycle": [
            {
                "hold": cycle.hold,
                "on_s": cycle.on_s,
                "period_s": cycle.period_s,
                "multipliers": _slowest(cycle.multipliers),
                "largest": cycle.largest,
                "simulated_largest": run.factor,
            }
            for cycle, run in zip(data.cycles, data.runs, strict=True)
        ],
        "burst_gaps": data.gaps,
    }


def _slowest(multipliers: NDArray[np.complex128]) -> Sequence[complex]:
    """Returns up to four multipliers of a burst cycle, largest first.

    Of each conjugate pair, only one multiplier is returned. Multipliers with a
    magnitude of at most 1e-3 are left out.
    """
    found = [complex(m) for m in multipliers if m.imag >= 0.0 and abs(m) > 1e-3]
    return found[:4]


def _render_bursts(data: BurstCycles, name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [
            cycle.hold + (" (current)" if cycle.hold == data.today else ""),
            ", ".join(f"{abs(m):.4f}" for m in _slowest(cycle.multipliers)),
            run.factor,
            "yes" if cycle.stable else "no",
        ]
        for cycle, run in zip(data.cycles, data.runs, strict=True)
    ]
    first = data.cycles[0]
    cycles = round(data.runs[0].time_s[-1] / first.period_s)
    return [
        paragraph(
            f"The source sounds for {first.on_s:g} s in every {first.period_s:g} s. "
            "Between two bursts, the target rests in W (`world`), moves with the "
            "robot (`robot`) or goes on with its own velocity (`motion`). A "
            "multiplier is the share of a deviation from rest that remains after one "
            "cycle. It comes from the product of the one-period matrices, and from a "
            f"fit to {cycles} simulated cycles after a kick along the line to the "
            "source; the fit shows the motion along this line only."
        ),
        table(["hold", "multipliers", "simulated, along", "stable"], rows),
        figure_html(
            plot_gap_chart(data.gaps),
            name,
            "Growth over the silence between bursts, for each way to hold the target.",
        ),
    ]


@dataclass(frozen=True)
class SamplingCharts:
    """Stability over sample period, gains, and delay, with the scenario marked."""

    conditions: tuple[ConditionCheck, ...]
    """Closed-form stability conditions of the sampled double integrator."""
    period: PolesAgainstPeriod
    charts: tuple[StabilityChart, ...]


def _sampling_document(data: SamplingCharts) -> dict[str, Any]:
    return {
        "sampling": {
            "conditions": data.conditions,
            "longest_stable_period_s": data.period.longest_stable_s,
            "charts": [
                {**vars(c), "stable_share": c.stable_share} for c in data.charts
            ],
        }
    }


def _sampling(study: Study) -> SamplingCharts:
    scenario = study.scenario
    return SamplingCharts(
        check_conditions(seed=scenario.seed, tick_s=scenario.tick_s),
        poles_against_period(scenario),
        (gain_chart(scenario), gain_delay_chart(scenario)),
    )


def _render_loci(data: Sequence[RootLocus], name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [f"`{locus.parameter}`", locus.loop, locus.today, locus.limit] for locus in data
    ]
    return [
        paragraph(
            "The figures show the poles ln(z)/T of the sampled loop as one gain "
            "varies, for the loop to the target and for the contact mode where the "
            "law is stiffest."
        ),
        table(["gain", "loop", "current", "stability ends at"], rows),
        figure_html(
            plot_root_loci(data),
            name,
            "Root loci with marks at the current poles.",
            scale=True,
        ),
    ]


def _render_sampling(data: SamplingCharts, name: str) -> list[str]:
    conditions: list[list[Cell]] = [
        [c.scheme, c.condition, c.pairs, c.stable, c.mismatches]
        for c in data.conditions
    ]
    return [
        table(
            ["scheme", "stable exactly for", "pairs tried", "stable", "mismatches"],
            conditions,
            caption="Sampled double integrator: closed form against eigenvalues",
        ),
        paragraph(
            "The loop to the target stays stable up to a sample period of "
            f"{data.period.longest_stable_s:.3g} s; the current period is "
            f"{data.period.today_s:g} s."
        ),
        figure_html(
            plot_poles_against_period(data.period),
            f"{name}-period",
            "Poles over the sample period.",
            scale=True,
        ),
        *(
            figure_html(
                plot_chart(chart),
                f"{name}-chart{k}",
                f"Growth: {chart.title}.",
                scale=True,
            )
            for k, chart in enumerate(data.charts)
        ),
    ]


def _render_contact(data: ContactLimits, name: str) -> list[str]:
    headings = ["motor lag (s)", *(f"{t} ticks" for t in data.latency_ticks)]
    rows: list[list[Cell]] = [
        [lag, *(float(value) for value in row)]
        for lag, row in zip(data.motor_lags_s, data.stiffness_n_m, strict=True)
    ]
    caption = (
        "Largest slope -df/dc of a law, N/m: now "
        f"{number(data.stiffness_today_n_m)} with the conventional law, "
        f"{number(data.active_slope_today_n_m)} with the active law of 2019"
    )
    lag, ticks = data.today
    return [
        paragraph(
            "Before an obstacle the law's spring adds to K_r, while the damping is "
            "still D_r. The table lists the largest springs with which the robot "
            "comes to rest, over the motors' lag and the age of an echo (in ticks of "
            f"{data.tick_s * 1e3:g} ms). This scenario has {lag:g} s and {ticks} "
            "ticks."
        ),
        table(headings, rows, caption=caption),
        figure_html(plot_contact_limits(data), name, "Limits of the contact mode."),
    ]


def gain_parts() -> tuple[Part, ...]:
    """Returns the part that recommends gains and states what these gains cost."""
    return (
        Part(
            "recommended_gains",
            "Recommended gains",
            lambda study: recommend_gains(study.scenario),
            _render_gains,
        ),
    )


def _render_gains(data: RecommendedGains, name: str) -> list[str]:
    t, today = data.requirements, data.today
    headings = [
        "K_r", "D_r", "damping ratio", "phase (deg)", "gain (dB)", "M_s", "disk",
        "delay (s)", "lag (m)", "to 2 % (s)", "stiffest law (N/m)",
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        ["Current gains"],
        _figures(today),
        ["Least D_r that meets all requirements"],
    ]
    rows += [
        _figures(choice.figures)
        if choice.figures
        else [choice.stiffness_n_m, "none", *([None] * 9)]
        for choice in data.choices
    ]
    return [
        paragraph(
            f"The requirements are a damping ratio of {t.damping_ratio:g}, a phase "
            f"margin of {t.phase_margin_deg:g} deg, a gain margin of "
            f"{t.gain_margin_db:g} dB, M_s of {t.sensitivity_peak:g}, a disk margin of "
            f"{t.disk_margin:.2f}, a delay margin of {t.delay_margin_s:g} s, at sensor "
            "and actuator, and rest before an obstacle with echoes that are "
            f"{t.spare_latency_ticks} tick late. The "
            "loop is the sampled loop of the attraction with motor lag; margins are "
            "the least in both directions. The lag is the distance of P behind the "
            "follow point of a source that moves like the source of this scenario. "
            "The stiffest law is the largest spring to obstacles with which P comes "
            "to rest."
        ),
        table(headings, rows),
        paragraph(data.advice),
    ]


def _figures(f: GainFigures) -> list[Cell]:
    return [
        f.stiffness_n_m, f.damping_n_s_m, f.damping_ratio, f.phase_margin_deg,
        f.gain_margin_db, f.sensitivity_peak, f.disk_margin, f.delay_margin_s,
        f.following_lag_m, f.settling_s, f.largest_law_stiffness_n_m,
    ]  # fmt: skip
