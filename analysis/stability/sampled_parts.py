"""Parts of the stability report: delay margins of the sampled loop, burst cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.linear.burst_cycle import (
    HOLDS,
    BurstCycle,
    BurstRun,
    burst_cycle,
    simulate_burst_cycle,
)
from analysis.linear.burst_gaps import GapChart, gap_chart
from analysis.linear.delay_margin import DELAY_PLACES, DelayMargin, delay_margin
from analysis.linear.delayed_run import DelayCheck, check_delay_margin
from analysis.models.open_loops import DIRECTIONS
from analysis.models.operating_points import OperatingPoint
from analysis.reporting.html_page import Cell, figure_html, paragraph, table
from analysis.stability.chart_plots import plot_delay_check, plot_gap_chart
from analysis.stability.law_analysis import Part, Study

__all__ = ["BurstCycles", "SampledLoop", "sampled_parts"]

#: Length of the runs that check delay margins in a short and a full report, s.
_CHECK_S = (60.0, 300.0)
#: Simulated cycles of the sound, as above.
_CYCLES = (20, 40)


@dataclass(frozen=True)
class SampledLoop:
    """Poles over a tick, and the delay that the loop stands."""

    period_s: float
    poles: NDArray[np.complex128]
    """z plane, of P's motion."""
    margins: tuple[DelayMargin, ...]
    """At sensor and wheels, along and across, where there is such a loop."""
    check: DelayCheck | None
    """Simulation beside the margin at the sensor; none: it is infinite."""

    @property
    def delay_margin_s(self) -> float:
        """Of the motion along the line to the source, late at the sensor, s."""
        found = [m for m in self.margins if (m.at, m.direction) == ("sensor", "along")]
        return found[0].delay_s if found else float("inf")


@dataclass(frozen=True)
class BurstCycles:
    """The burst cycle with each way to hold the target."""

    today: str
    """``tracker.hold`` of the scenario."""
    cycles: tuple[BurstCycle, ...]
    runs: tuple[BurstRun, ...]
    """Simulated, in the same order."""
    gaps: GapChart
    """Against the length of the silence."""


def sampled_parts(*, full: bool) -> tuple[Part, ...]:
    """Delay margins, exact and simulated; multipliers of the burst cycle."""
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
            "The delay that may be added before the loop oscillates, in fractions of a "
            "tick: the spectral radius of the one-period map with the delay in it is "
            "bisected. At the sensor an estimate comes later than the tracker takes it "
            "to; at the wheels a command does."
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
                ["of the margin", "delay (s)", "growth (1/s)", "rad/s"],
                checks,
                caption="The diagram with that delay at the sensor, simulated for "
                f"{data.check.below.duration_s:g} s after a small kick",
            )
        )
        parts.append(
            figure_html(
                plot_delay_check(data.check), name, "Just below the margin, and above."
            )
        )
    return parts


def _bursts(study: Study, count: int) -> BurstCycles:
    at: OperatingPoint = study.need("equilibria").at
    cycles = tuple(burst_cycle(study.scenario, hold, point=at) for hold in HOLDS)
    runs = tuple(simulate_burst_cycle(cycle, count) for cycle in cycles)
    gaps = gap_chart(study.scenario, point=at)
    return BurstCycles(study.scenario.tracker.hold, cycles, runs, gaps)


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
    """One of each pair, largest first, of those that count."""
    found = [complex(m) for m in multipliers if m.imag >= 0.0 and abs(m) > 1e-3]
    return found[:4]


def _render_bursts(data: BurstCycles, name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [
            cycle.hold + (" (today)" if cycle.hold == data.today else ""),
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
            f"The source sounds for {first.on_s:g} s in every {first.period_s:g} s. In "
            "between, the target rests in W (`world`), moves with the robot (`robot`) "
            "or goes on with its own velocity (`motion`). A multiplier is the share of "
            "what was off that is left after a cycle, about rest: from the product of "
            f"the one-period matrices, and fitted to {cycles} simulated cycles after a "
            "kick along the line to the source, which shows the motion along it only."
        ),
        table(["hold", "multipliers", "simulated, along", "stable"], rows),
        figure_html(
            plot_gap_chart(data.gaps),
            name,
            "Growth against the silence between bursts, for each way to hold.",
        ),
    ]
