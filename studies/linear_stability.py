"""Linear stability in numbers.

The tables of docs/results_stability.md, and its pictures with ``--pictures``.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from analysis.loops.burst_cycle import HOLDS, burst_cycle, simulate_burst_cycle
from analysis.loops.contact_mode import contact_limits
from analysis.loops.delay_margin import DELAY_PLACES, DelayedLoop
from analysis.loops.delayed_run import check_delay_margin
from analysis.loops.equilibria import find_equilibria, follow_equilibrium
from analysis.loops.linearization import check_gradient, compare_routes
from analysis.loops.loop_margins import all_margins, loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.loops.open_loops import DIRECTIONS, BreakPoint, target_loop
from analysis.loops.operating_points import OperatingPoint, moving_equilibrium
from analysis.loops.step_response import check_step
from diagrams import load_scenario
from diagrams.scenario.scenario import Scenario
from studies.linear.burst_gaps import gap_chart
from studies.linear.root_locus import RootLocus, root_loci
from studies.linear.sampled_stability import check_conditions, poles_against_period
from studies.tables import Table
from systems.framework.signals import TICK_S

#: Kim's conventional law is left out: between rho_1 and mu_1 his laws are the same.
LAWS = ("none", "conventional", "active", "active2017")
#: Differences below this are those of rounding.
ROUNDING = 1e-11
#: Slower modes are of the motion, faster ones of motors and filters, rad/s.
_MOTION_RAD_S = 5.0


def _points() -> Iterator[tuple[str, str, OperatingPoint]]:
    for law in LAWS:
        scenario = Scenario(law=law)
        yield law, "at rest", follow_equilibrium(scenario)
        yield law, "following at 0.3 m/s", moving_equilibrium(scenario)


def apart(difference: float) -> str:
    """A difference of numbers near 1; 0 where it is that of rounding.

    The last digits hang on the machine: some thousand roundings of 1e-16 each.
    """
    return "0" if abs(difference) < ROUNDING else f"{difference:.0e}"


def route_rows() -> Iterator[Sequence[str]]:
    """Two ways to the model, point by point."""
    for law, state, point in _points():
        routes, check = compare_routes(point), check_gradient(point)
        yield (
            law,
            state,
            f"{routes.states}",
            apart(routes.matrix_difference),
            f"{apart(routes.pole_difference)} ({len(routes.simple_poles)} poles)",
            f"{check.largest_difference:.0e}",
            f"{check.kink:.2g}" if check.kink > 1e-3 else "none",
        )


def mode_rows() -> Iterator[Sequence[str]]:
    """Modes at rest and following, law by law."""
    for law, state, point in _points():
        for mode in point.modes:
            s = mode.eigenvalue
            if abs(s) < _MOTION_RAD_S:
                tail = f" +- {s.imag:.4f}j" if s.imag > 0.0 else ""
                yield (
                    law,
                    state,
                    f"{abs(point.offset_m):.3f}",
                    f"{s.real:.4f}{tail}",
                    f"{mode.damping_ratio:.3f}",
                    f"{mode.frequency_rad_s:.3f}",
                )


def _margin_cells(found: LoopMargins) -> Sequence[str]:
    up, down, disk = found.gain_increase_margin, found.gain_reduction_margin, found.disk
    sizes = f"{disk.gain_margin_db:.1f} dB, {disk.phase_margin_deg:.0f} deg"
    return (
        f"{up:.1f}" if math.isfinite(up) else "any",
        f"{down:.3f}" if down > 0.0 else "any",
        f"{found.phase_margin_deg:.2f}",
        f"{found.crossover_rad_s:.3f}",
        f"{found.modulus_margin:.3f}",
        f"{disk.alpha:.3f} ({sizes})",
    )


def margin_rows() -> Iterator[Sequence[str]]:
    """Margins of the ideal target loop, and of every cut of each law's loop."""
    ideal: tuple[BreakPoint, ...] = ("sensor", "actuator")
    for at in ideal:
        margins = loop_margins(target_loop(Scenario(), at))
        yield "ideal target loop", at, *_margin_cells(margins)
    for law in LAWS:
        for found in all_margins(follow_equilibrium(Scenario(law=law))):
            place = f"{found.at}, {found.direction}"
            yield law, place, *_margin_cells(found.margins)


def _delays(duration_s: float) -> Iterator[Sequence[str]]:
    for law in LAWS:
        point = follow_equilibrium(Scenario(law=law))
        for at in DELAY_PLACES:
            check = check_delay_margin(point, at, duration_s=duration_s)
            loop, cells = DelayedLoop(point, at), []
            for run in (check.below, check.above):
                growth = math.log(loop.spectral_radius(run.delay_s)) / TICK_S
                cells.append(f"{growth:+.5f}, {run.growth_per_s:+.5f}")
            yield (
                law,
                at,
                f"{check.margin.delay_s:.4f}",
                f"{check.margin.frequency_rad_s:.3f}",
                *cells,
                "yes" if check.confirmed else "no",
            )


def _bursts() -> Iterator[Sequence[str]]:
    for law in ("none", "active"):
        scenario = Scenario(law=law)
        point = follow_equilibrium(scenario)
        for hold in HOLDS:
            cycle = burst_cycle(scenario, hold, point=point)
            for direction in DIRECTIONS:
                found = getattr(cycle, direction)
                if direction == "along" or not point.continuum:
                    run = simulate_burst_cycle(cycle, direction=direction)
                    cells = f"{abs(found[0]):.4f}", f"{run.factor:.4f}"
                    yield law, hold, direction, *cells


def contact_rows() -> Iterator[Sequence[str]]:
    """Largest K_0 and k_ref, a motor lag a row."""
    limits = contact_limits(Scenario())
    for lag, soft, stiff in zip(
        limits.motor_lags_s,
        limits.stiffness_n_m,
        limits.reference_stiffness_n_m,
        strict=True,
    ):
        pairs = zip(soft, stiff, strict=True)
        yield (f"{1e3 * lag:.0f} ms", *(f"{a:.1f}, {b:.0f}" for a, b in pairs))


def limit_rows() -> Iterator[Sequence[str]]:
    """Largest stable gains and sample period; the other values are the scenario's."""
    scenario = Scenario(law="none")
    period = poles_against_period(scenario)
    longest = f"{period.longest_stable_s:.3g}"
    yield "none", "`tick_s`", "target", f"{period.today_s:g}", longest
    for law in LAWS:
        for locus in root_loci(Scenario(law=law)):
            if law == "none" or locus.loop == "contact":
                yield (
                    law,
                    f"`{locus.parameter}`",
                    locus.loop,
                    f"{locus.today:.3g}",
                    _limit(locus),
                )


def _limit(locus: RootLocus) -> str:
    if (locus.poles_today.real >= 0.0).any():
        return "unstable now"
    return "any" if locus.limit is None else f"{locus.limit:.3g}"


def silence_rows() -> Iterator[Sequence[str]]:
    """Longest stable silence of the sound for each setting of ``tracker.hold``."""
    for law in ("none", "active"):
        chart = gap_chart(Scenario(law=law))
        for hold in chart.holds:
            longest = chart.longest_stable_s(hold)
            more = " or more" if longest == chart.gaps_s[-1] else ""
            yield law, hold, f"{longest:g}{more}"


def _steps() -> Iterator[Sequence[str]]:
    for law in LAWS:
        check = check_step(Scenario(law=law), full=True)
        cells = [
            f"{one.frequency_rad_s:.4f}, {one.damping_ratio:.4f}"
            for one in (check.predicted, check.ideal, check.full)
            if one is not None
        ]
        errors = f"{check.frequency_error:+z.2%}, {check.damping_error:+z.2%}"
        yield law, *cells, errors


def equilibrium_rows() -> Iterator[Sequence[str]]:
    """Numbers of equilibria by kind."""
    for name in ("default", "two_static_obstacles"):
        for law in LAWS[1:]:
            search = find_equilibria(load_scenario(name, [f"law={law}"]))
            kinds = [point.kind for point in search.points]
            yield (
                name,
                law,
                *(f"{kinds.count(kind)}" for kind in ("sink", "saddle", "source")),
                f"{len(search.switching)}",
                f"{sum(point.attractive for point in search.switching)}",
                "yes" if search.complete else "no",
            )


def tables(duration_s: float = 300.0) -> Iterator[Table]:
    """All tables.

    Args:
        duration_s: Of the runs that check delay margins, s.
    """
    yield Table(
        "equilibria",
        ("scenario", "law", "sinks", "saddles", "sources", "switching",
         "attractive", "complete"),
        equilibrium_rows(),
    )  # fmt: skip
    yield Table(
        "two ways to the model",
        ("law", "operating point", "states", "matrices apart", "poles apart",
         "AutoDiff against differences", "corner"),
        route_rows(),
    )  # fmt: skip
    yield Table(
        "modes",
        ("law", "operating point", "offset (m)", "pole (rad/s)", "damping ratio",
         "frequency (rad/s)"),
        mode_rows(),
    )  # fmt: skip
    yield Table(
        "steps",
        ("law", "predicted (rad/s, ratio)", "all ideal", "audio and cones",
         "prediction off"),
        _steps(),
    )  # fmt: skip
    yield Table(
        "margins",
        ("loop", "cut at", "gain up to", "gain down to", "phase margin (deg)",
         "crossover (rad/s)", "modulus margin", "disk"),
        margin_rows(),
    )  # fmt: skip
    yield Table(
        "delay margins",
        ("law", "delay at", "margin (s)", "frequency (rad/s)",
         "growth at 0.95: computed, simulated (1/s)",
         "at 1.05", "confirmed"),
        _delays(duration_s),
    )  # fmt: skip
    yield Table(
        "sampled conditions",
        ("scheme", "condition", "pairs", "stable", "mismatches"),
        (
            (check.scheme, f"`{check.condition}`", *(
                f"{n}" for n in (check.pairs, check.stable, check.mismatches)
            ))
            for check in check_conditions()
        ),
    )  # fmt: skip
    yield Table(
        "stability limits",
        ("law", "parameter", "loop", "current", "stable up to"),
        limit_rows(),
    )
    yield Table(
        "bursts",
        ("law", "hold", "direction", "largest multiplier", "simulated"),
        _bursts(),
    )
    yield Table(
        "silences", ("law", "hold", "stable up to a silence of (s)"), silence_rows()
    )
    latencies = contact_limits(Scenario()).latency_ticks
    yield Table(
        "contact",
        ("motor lag", *(f"{25 * ticks} ms late" for ticks in latencies)),
        contact_rows(),
    )


def draw(directory: Path) -> None:
    """The page's pictures."""
    from analysis.loops.linear_plots import (
        plot_contact_limits,
        plot_equilibria,
        plot_nyquist,
    )
    from studies.linear.charts import (
        plot_chart,
        plot_gap_chart,
        plot_poles_against_period,
        plot_root_loci,
    )
    from studies.linear.sampled_stability import gain_chart, gain_delay_chart

    directory.mkdir(parents=True, exist_ok=True)
    scenario = Scenario(law="active")
    margins = [found.margins for found in all_margins(follow_equilibrium(scenario))]
    search = find_equilibria(load_scenario("two_static_obstacles", ["law=active"]))
    for name, figure in {
        "equilibria": plot_equilibria(search),
        "nyquist": plot_nyquist(margins),
        "burst_gaps": plot_gap_chart(gap_chart(Scenario(law="none"))),
        "contact_limits": plot_contact_limits(contact_limits(scenario)),
        "root_loci": plot_root_loci(root_loci(scenario)),
        "sample_period": plot_poles_against_period(poles_against_period(scenario)),
        "stable_gains": plot_chart(gain_chart(scenario)),
        "stable_delays": plot_chart(gain_delay_chart(scenario)),
    }.items():
        figure.savefig(directory / f"{name}.png", dpi=90)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the study."""
    parser.add_argument("--pictures", type=Path, help="directory to draw into")
    parser.add_argument(
        "--duration", type=float, default=300.0, help="of the delayed runs, s"
    )


def run(options: argparse.Namespace) -> Iterator[Table]:
    """All tables; draws the pictures where they are asked for."""
    yield from tables(options.duration)
    if options.pictures is not None:
        draw(options.pictures)
