"""Parts of the stability report: delay, bursts, and contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.burst_cycle import (
    HOLDS,
    BurstCycle,
    BurstRun,
    burst_cycle,
    simulate_burst_cycle,
)
from analysis.loops.contact_mode import ContactLimits, contact_limits, contact_model
from analysis.loops.delay_margin import DELAY_PLACES, DelayMargin, delay_margin
from analysis.loops.delayed_run import DelayCheck, check_delay_margin
from analysis.loops.linear_plots import plot_contact_limits, plot_delay_check
from analysis.loops.open_loops import DIRECTIONS
from analysis.loops.operating_points import OperatingPoint
from analysis.loops.radial_law import radial_law
from analysis.report.criterion import Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Cell, Column, Content, Figure, Table, number
from analysis.stability.law_analysis import Part, Study
from analysis.stability.requirements import REQUIRED
from diagrams import Scenario

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
    """Simulations with a delay at the sensor just below and just above the margin, for
    motion along the line to the source. None if this margin is infinite or missing."""

    @property
    def least(self) -> DelayMargin | None:
        """The smallest delay margin; None if there are none."""
        return min(self.margins, key=attrgetter("delay_s"), default=None)

    @property
    def least_s(self) -> float:
        """The smallest delay margin, s. NaN if there are none."""
        return self.least.delay_s if self.least else math.nan


@dataclass(frozen=True)
class BurstCycles:
    """Stability of the motion over cycles of a burst of sound and the silence after it.

    There is one result for each hold. A hold is a rule for the motion of the target
    during the silence.
    """

    today: str
    """Hold of the scenario, which is the value of the field ``tracker.hold``."""
    cycles: tuple[BurstCycle, ...]
    runs: tuple[BurstRun, ...]
    """One simulated run per entry of ``cycles``, in the same order."""


def _sampled(study: Study) -> SampledLoop:
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
            check = check_delay_margin(at, duration_s=_CHECK_S[study.full])
    return SampledLoop(at.loop.tick_s, at.motion.poles, margins, check)


def _sampled_document(data: SampledLoop) -> dict[str, Any]:
    run = ("delay_s", "duration_s", "growth_per_s", "frequency_rad_s")
    return {
        **pick(data, "period_s", "poles", "least_s", "margins"),
        "check": data.check
        and {
            "below": pick(data.check.below, *run),
            "above": pick(data.check.above, *run),
            "confirmed": data.check.confirmed,
        },
    }


def _show_sampled(data: SampledLoop) -> list[Content]:
    contents: list[Content] = [
        (
            "A delay margin is the smallest additional delay with which the loop is no "
            "longer stable. It need not be a whole number of ticks. It comes from "
            "bisection on the spectral radius of the one-period map with that delay. A "
            "delay at the sensor makes an estimate later than the tracker assumes; a "
            "delay at the wheels makes a command later."
        ),
        Table.of(
            data.margins,
            {
                "late at": "at",
                "motion": "direction",
                Column("delay", "s"): "delay_s",
                "ticks": lambda margin: margin.delay_s / data.period_s,
                "rad/s": "frequency_rad_s",
            },
        ),
    ]
    check = data.check
    if check:
        contents += [
            Table.of(
                [("0.95", check.below), ("1.05", check.above)],
                {
                    "share of the margin": lambda run: run[0],
                    Column("delay", "s"): lambda run: run[1].delay_s,
                    Column("growth", "1/s"): lambda run: run[1].growth_per_s,
                    "rad/s": lambda run: run[1].frequency_rad_s,
                },
                "Simulation of the diagram with that delay at the sensor, for "
                f"{check.below.duration_s:g} s after a small kick",
            ),
            Figure(
                lambda: plot_delay_check(check),
                "Runs just below the margin and just above it.",
            ),
        ]
    return contents


#: Delay margins of the sampled loop.
DELAY_MARGINS = Part[SampledLoop](
    "delay_margins",
    "Delay margins of the sampled loop",
    _sampled,
    _show_sampled,
    criteria=(
        Criterion(
            "least delay margin", "s", "at least", REQUIRED.delay_margin_s,
            "it tolerates more added delay than the threshold",
            "less added delay than the threshold makes it oscillate",
            "set by this project; exact margin of the sampled loop",
            lambda data: data.least_s,
            lambda data: (
                f"at the {data.least.at}, {data.least.direction}" if data.least else ""
            ),
        ),
    ),
    document=_sampled_document,
)  # fmt: skip


def _bursts(study: Study) -> BurstCycles:
    at: OperatingPoint = study.need("equilibria").at
    cycles = tuple(burst_cycle(study.scenario, hold, point=at) for hold in HOLDS)
    runs = tuple(simulate_burst_cycle(cycle, _CYCLES[study.full]) for cycle in cycles)
    return BurstCycles(study.scenario.follower.tracker.hold, cycles, runs)


def _burst_document(data: BurstCycles) -> dict[str, Any]:
    return {
        "hold": data.today,
        "cycles": [
            {
                **pick(cycle, "hold", "on_s", "period_s", "largest"),
                "multipliers": _slowest(cycle.multipliers),
                "simulated_largest": run.factor,
            }
            for cycle, run in zip(data.cycles, data.runs, strict=True)
        ],
    }


def _slowest(multipliers: NDArray[np.complex128]) -> Sequence[complex]:
    """Returns up to four multipliers, largest first, one of each conjugate pair."""
    found = [complex(m) for m in multipliers if m.imag >= 0.0 and abs(m) > 1e-3]
    return found[:4]


def _show_bursts(data: BurstCycles) -> list[Content]:
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
        (
            f"The source sounds for {first.on_s:g} s in every {first.period_s:g} s. "
            "Between two bursts, the target rests in W (`world`), moves with the robot "
            "(`robot`) or goes on with its own velocity (`motion`). A multiplier is "
            "the share of a deviation from rest that remains after one cycle. It comes "
            f"from the product of the one-period matrices, and from a fit to {cycles} "
            "simulated cycles after a kick along the line to the source; the fit shows "
            "the motion along this line only."
        ),
        Table(["hold", "multipliers", "simulated, along", "stable"], rows),
    ]


BURST_CYCLE = Part[BurstCycles](
    "burst_cycle",
    "Burst cycle",
    _bursts,
    _show_bursts,
    criteria=(
        Criterion(
            "deviation remaining after a burst cycle", "", "below", 1.0,
            "it settles although the source is silent most of the time",
            "it swings ever farther because the source is silent most of the time",
            "stability over a cycle of the sound",
            lambda data: next(c.largest for c in data.cycles if c.hold == data.today),
            lambda data: f"hold `{data.today}`",
        ),
    ),
    document=_burst_document,
)  # fmt: skip


@dataclass(frozen=True)
class ContactMode:
    """Motion in front of an obstacle, where the law adds a spring to the attraction."""

    limits: ContactLimits
    growth_per_s: float | None
    """Growth rate where the law is stiffest, 1/s. None if the law does not push away
    from obstacles."""
    growth_one_tick_late_per_s: float | None
    """The same growth rate if echoes arrive one control period later, 1/s."""


def contact_growth(scenario: Scenario, ticks: int) -> float | None:
    """Returns the growth rate of the motion in front of an obstacle, 1/s.

    The obstacle acts as a spring with the largest stiffness of the law. The measured
    position of the obstacle is ``ticks`` control periods old. The result is negative if
    the motion decays. It is None if the law does not push away from obstacles.
    """
    stiffness = radial_law(scenario).stiffest_n_m
    if stiffness <= 0.0:
        return None
    total = scenario.follower.attraction.stiffness_n_m + stiffness
    return contact_model(scenario, total, latency_ticks=ticks).growth_per_s


def _contact_mode(study: Study) -> ContactMode:
    scenario = study.scenario
    growth = (contact_growth(scenario, ticks) for ticks in (0, 1))
    return ContactMode(contact_limits(scenario), *growth)


def _of_push(growth_per_s: float | None) -> Reading:
    if growth_per_s is None:
        return "the law does not push off obstacles"
    return growth_per_s


def _show_contact(data: ContactMode) -> list[Content]:
    limits = data.limits
    lag, ticks = limits.today
    rows: list[list[Cell]] = [
        [lag_s, *map(float, row)]
        for lag_s, row in zip(limits.motor_lags_s, limits.stiffness_n_m, strict=True)
    ]
    return [
        (
            "In front of an obstacle, the stiffness of the law adds to K_r, and the "
            "damping is D_r. The table lists the largest stiffness of a law with which "
            "the robot comes to rest, for several motor lags and ages of the echoes "
            f"(in ticks of {limits.tick_s * 1e3:g} ms). In this scenario, the motor "
            f"lag is {lag:g} s, and echoes are {ticks} ticks old."
        ),
        Table(
            [Column("motor lag", "s"), *(f"{t} ticks" for t in limits.latency_ticks)],
            rows,
            "Largest slope -df/dc of a law, N/m: now "
            f"{number(limits.stiffness_today_n_m)} with the conventional law, "
            f"{number(limits.active_slope_today_n_m)} with the active law of 2019",
        ),
        Figure(lambda: plot_contact_limits(limits), "Limits of the contact mode."),
    ]


CONTACT_MODE = Part[ContactMode](
    "contact_mode",
    "Contact mode",
    _contact_mode,
    _show_contact,
    criteria=(
        Criterion(
            "growth where the law is stiffest", "1/s", "below", 0.0,
            "it comes to rest in front of an obstacle, even where the law is stiffest",
            "it swings in front of an obstacle, where the law is stiffest",
            "stability of the contact mode at the law's largest slope",
            lambda data: _of_push(data.growth_per_s),
        ),
        Criterion(
            "growth where the law is stiffest, echoes one tick late", "1/s", "below",
            0.0,
            "the loop tolerates a processor that needs one more tick",
            "with one more tick of latency it swings where the law is stiffest",
            "set by this project",
            lambda data: _of_push(data.growth_one_tick_late_per_s),
        ),
    ),
)  # fmt: skip
