"""Parts of the stability report: stability margins, and gains that meet them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.loops.gang_of_four import GangOfFour, gang_of_four
from analysis.loops.heading_loop import HeadingLoopMargins, heading_loop_margins
from analysis.loops.linear_models import LinearModel
from analysis.loops.linear_plots import (
    plot_bode,
    plot_gang_of_four,
    plot_nichols,
    plot_nyquist,
)
from analysis.loops.loop_margins import PointMargins, all_margins, loop_margins
from analysis.loops.margin_results import DiskMargin, LoopMargins
from analysis.loops.open_loops import BREAK_POINTS, target_loop
from analysis.loops.operating_points import OperatingPoint
from analysis.report.criterion import Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Cell, Column, Content, Figure, Table, number
from analysis.stability.attraction_search import (
    GainFigures,
    RecommendedGains,
    recommend_gains,
)
from analysis.stability.law_analysis import Data, Part, Study
from analysis.stability.requirements import REQUIRED

#: Explanation of the margins for readers of the report.
_EXPLANATION = (
    "Each loop is cut at one place while the others stay closed: at the sensor (the "
    "source as it is heard), at the actuator (the law's acceleration) or at the "
    "commanded wheel speeds, along the line to the source and across it. The gain "
    "margins are the smallest increase and the smallest decrease of the gain that "
    "make the loop unstable; the phase margin is the smallest such lag or lead. A "
    "disk margin covers changes of gain and phase at the same time; the table lists "
    "the gains and phases for which it guarantees stability."
)
#: Modes with a higher natural frequency belong to motors and filters, rad/s.
_SLOW_RAD_S = 12.0
#: Fields of ``LoopMargins`` in the table of margins, with their columns.
_COLUMNS = {
    "gain_increase_margin_db": Column("gain up", "dB"),
    "gain_reduction_margin_db": Column("gain down", "dB"),
    "phase_margin_deg": Column("phase", "deg"),
    "crossover_rad_s": Column("crossover", "rad/s"),
    "modulus_margin": Column("modulus"),
    "sensitivity_peak": Column("M_s"),
    "complementary_peak": Column("M_t"),
    "delay_margin_s": Column("delay", "s"),
}
#: Publication that gives the usual phase margin and gain margin.
_USUAL = "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)"
#: Place and direction of the cut whose margins stand for the whole implemented loop in
#: the JSON document.
_MAIN = ("sensor", "along")


@dataclass(frozen=True)
class Margins:
    """Stability margins of the ideal target loop and of the implemented loop.

    The target loop contains only the attraction. It has no motor lag, no sampling, and
    no obstacles. The implemented loop is the loop of the block diagram.
    """

    target: dict[str, LoopMargins]
    """Margins of the target loop, by the place of the cut."""
    target_model: LinearModel
    """Linear model of the target loop, cut at the sensor."""
    implemented: tuple[PointMargins, ...]
    """Margins of the implemented loop, one entry for each place and direction of the
    cut."""
    gangs: tuple[GangOfFour, ...]
    """Gang of four (the four sensitivity functions) of each loop that is cut at the
    sensor."""
    at: OperatingPoint
    """Operating point of the implemented loop."""

    def implemented_at(self, at: str, direction: str) -> LoopMargins | None:
        """Returns the margins of the implemented loop for one cut.

        ``at`` is the place of the cut: ``sensor``, ``actuator``, or ``wheels``. The
        direction of the motion is ``along`` the line to the source, or ``across`` it.
        The result is None if the implemented loop has no such cut.
        """
        for found in self.implemented:
            if (found.at, found.direction) == (at, direction):
                return found.margins
        return None

    @property
    def target_poles(self) -> NDArray[np.complex128]:
        """(n,) poles of the closed target loop, 1/s."""
        model = self.target_model
        return np.linalg.eigvals(model.A - model.B @ model.C).astype(complex)


def least_damped(poles: NDArray[np.complex128]) -> complex:
    """Returns the slow oscillating pole with the least damping ratio, 1/s.

    A pole is slow if its magnitude is below 12 rad/s; faster poles belong to motors and
    filters. If no slow pole oscillates, the function returns the pole with the largest
    real part. Of a conjugate pair, it returns the pole with the positive imaginary
    part. ``poles`` are (n,) poles in the s plane, 1/s.
    """
    slow = poles[np.abs(poles) < _SLOW_RAD_S]
    swinging = slow[np.abs(slow.imag) > 1e-6]
    if len(swinging) == 0:
        return complex(poles[np.argmax(poles.real)])
    pole = complex(swinging[np.argmin(-swinging.real / np.abs(swinging))])
    return pole if pole.imag > 0.0 else pole.conjugate()


def _margins(study: Study) -> Margins:
    at: OperatingPoint = study.need("equilibria").at
    models = {
        place: target_loop(study.scenario, place)
        for place in BREAK_POINTS
        if place != "wheels"
    }
    implemented = all_margins(at)
    return Margins(
        {place: loop_margins(model) for place, model in models.items()},
        models["sensor"],
        implemented,
        tuple(gang_of_four(at, m.direction) for m in implemented if m.at == "sensor"),
        at,
    )


def _document(data: Margins) -> dict[str, Any]:
    sensor = data.implemented_at(*_MAIN) or data.implemented[0].margins
    return {
        "target_loop": {
            "cut_at": "sensor",
            **_loop_document(data.target_poles, data.target["sensor"]),
            "margins": {at: m.document() for at, m in data.target.items()},
        },
        "implemented_loop": {
            "cut_at": sensor.name,
            **_loop_document(data.at.eigenvalues, sensor),
            "margins": {
                f"{found.at}_{found.direction}": found.margins.document()
                for found in data.implemented
            },
        },
    }


def _loop_document(
    poles: NDArray[np.complex128], margins: LoopMargins
) -> dict[str, Any]:
    pole = least_damped(poles)
    return {
        "poles": poles,
        "damping_ratio": -pole.real / abs(pole),
        "natural_frequency_rad_s": abs(pole),
        "gain_margin_db": margins.gain_margin_db,
        "phase_margin_deg": margins.phase_margin_deg,
        "delay_margin_s": margins.delay_margin_s,
        "disk_margin": margins.disk.alpha,
    }


def _show(data: Margins) -> list[Content]:
    rows: list[list[Cell]] = [["Ideal target loop: no lag, no sampling, no obstacle"]]
    rows += [_row(at, "along", margins) for at, margins in data.target.items()]
    tick_ms = 1e3 * data.at.loop.tick_s
    rows.append([f"Implemented loop, {tick_ms:g} ms, at the operating point"])
    rows += [_row(m.at, m.direction, m.margins) for m in data.implemented]
    loops = [m.margins for m in data.implemented]
    skews = [f"skew {disk.skew:+g}" for disk in loops[0].disks]
    disks: list[list[Cell]] = [
        [m.at, m.direction, *_disk_cells(m.margins.disks)] for m in data.implemented
    ]
    return [
        _EXPLANATION,
        Table(["cut at", "direction", *_COLUMNS.values()], rows),
        Table(
            ["cut at", "direction", *skews],
            disks,
            "Disk margins: size alpha; range of the gain in dB; phase, plus or minus, "
            "in deg",
        ),
        Figure(lambda: plot_bode(loops), "Bode diagram with margins."),
        Figure(
            lambda: plot_nyquist(loops),
            "Nyquist curves, and the disk that they must not enter.",
        ),
        Figure(lambda: plot_nichols(loops), "Nichols diagram."),
        *(
            Figure(
                partial(plot_gang_of_four, gang),
                f"Gang of four, {gang.direction} the line to the source.",
            )
            for gang in data.gangs
        ),
    ]


def _row(at: str, direction: str, margins: LoopMargins) -> list[Cell]:
    return [at, direction, *pick(margins, *_COLUMNS).values()]


def _disk_cells(disks: Sequence[DiskMargin]) -> list[Cell]:
    return [
        f"{disk.alpha:.3f}; {_db(disk.gain_low)} to {_db(disk.gain_high)}; "
        f"{disk.phase_margin_deg:.1f}"
        for disk in disks
    ]


def _db(factor: float) -> str:
    return number(20.0 * math.log10(factor) if factor > 0.0 else -math.inf, 3)


def margin_criteria(
    loops: Callable[[Data], Sequence[LoopMargins]],
) -> tuple[Criterion[Data], ...]:
    """Returns criteria for the worst margins over several cut loops.

    ``loops`` is a function from the data object of a part to the margins of these cut
    loops.
    """
    return (
        Criterion(
            "least phase margin", "deg", "at least", REQUIRED.phase_margin_deg,
            "every cut loop tolerates the usual extra phase lag or lead",
            "a small extra phase makes the loop oscillate",
            _USUAL,
            *_worst(min, attrgetter("phase_margin_deg"), loops),
        ),
        Criterion(
            "least gain margin", "dB", "at least", REQUIRED.gain_margin_db,
            "gains may double, or fall to half",
            "a gain that is off by less than a factor of two, up or down, makes it "
            "unstable",
            _USUAL,
            *_worst(min, attrgetter("gain_margin_db"), loops),
        ),
        Criterion(
            "largest sensitivity peak", "", "at most", REQUIRED.sensitivity_peak,
            "disturbances are hardly amplified",
            "disturbances near the crossover are amplified more than twice",
            "usual: M_s of 1.2 to 2.0 (Astrom and Murray)",
            *_worst(max, attrgetter("sensitivity_peak"), loops),
        ),
    )  # fmt: skip


def _worst(
    choose: Callable[..., LoopMargins | None],
    value: Callable[[LoopMargins], float],
    loops: Callable[[Data], Sequence[LoopMargins]],
) -> tuple[Callable[[Data], Reading], Callable[[Data], str]]:
    """Returns ``read`` and ``where`` of a criterion for the worst of several cut loops.

    ``choose`` is ``min`` or ``max``, and ``value`` takes the margin of a loop.
    """

    def found(data: Data) -> LoopMargins | None:
        return choose(loops(data), key=value, default=None)

    def read(data: Data) -> Reading:
        worst = found(data)
        return value(worst) if worst else math.nan

    def where(data: Data) -> str:
        worst = found(data)
        return worst.name.removeprefix("L ") if worst else ""

    return read, where


def _all_cuts(data: Margins) -> list[LoopMargins]:
    return [each.margins for each in data.implemented]


MARGINS = Part[Margins](
    "margins",
    "Margins",
    _margins,
    _show,
    criteria=(
        *margin_criteria(_all_cuts),
        Criterion(
            "least disk margin", "", "at least", REQUIRED.disk_margin,
            "gain and phase may change at once; alone, by 6 dB or by 37 deg",
            "a small change of gain and phase at once makes the loop oscillate",
            "alpha = 2/3: 6 dB in each direction (Seiler, Packard and Gahinet 2020)",
            *_worst(min, attrgetter("disk.alpha"), _all_cuts),
        ),
    ),
    document=_document,
    models=lambda data: (data.target_model,),
)  # fmt: skip


def _show_gains(data: RecommendedGains) -> list[Content]:
    t, today = data.requirements, data.today
    columns: list[Column | str] = [
        "K_r", "D_r", "damping ratio", Column("phase", "deg"), Column("gain", "dB"),
        "M_s", "disk", Column("delay", "s"), Column("lag", "m"), Column("to 2 %", "s"),
        Column("stiffest law", "N/m"),
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
        (
            f"The requirements are a damping ratio of {t.damping_ratio:g}, a phase "
            f"margin of {t.phase_margin_deg:g} deg, a gain margin of "
            f"{t.gain_margin_db:g} dB, M_s of {t.sensitivity_peak:g}, a disk margin of "
            f"{t.disk_margin:.2f}, a delay margin of {t.delay_margin_s:g} s, at sensor "
            "and actuator, and rest before an obstacle with echoes that are "
            f"{t.spare_latency_ticks} tick late. The loop is the sampled loop of the "
            "attraction with motor lag; margins are the least in both directions. The "
            "lag is the distance of P behind the follow point of a source that moves "
            "like the source of this scenario. The stiffest law is the largest spring "
            "to obstacles with which P comes to rest."
        ),
        Table(columns, rows),
        data.advice,
    ]


def _figures(f: GainFigures) -> list[Cell]:
    return [
        f.stiffness_n_m, f.damping_n_s_m, f.damping_ratio, f.phase_margin_deg,
        f.gain_margin_db, f.sensitivity_peak, f.disk_margin, f.delay_margin_s,
        f.following_lag_m, f.settling_s, f.largest_law_stiffness_n_m,
    ]  # fmt: skip


RECOMMENDED_GAINS = Part[RecommendedGains](
    "recommended_gains",
    "Recommended gains",
    lambda study: recommend_gains(study.scenario),
    _show_gains,
)


def _heading_loop(study: Study) -> HeadingLoopMargins:
    scenario = study.scenario
    return heading_loop_margins(
        scenario.searcher.motor_driver,
        scenario.only.robot,
        scenario.only.plant.motor_lag_s,
        scenario.tick_s,
    )


def _show_heading(data: HeadingLoopMargins) -> list[Content]:
    return [
        (
            "A searching robot stops, decides on a heading, and turns to it while it "
            "drives. The loop has a compass, a PID controller, pulse widths, motors "
            "and the heading that the wheels produce; PID output and motor duties are "
            "held over a tick. The loop is cut at the deviation of the heading. It is "
            "linear for deviations within L and within all limits; with a larger "
            "deviation the robot turns on the spot, more slowly than the linear loop "
            "would. Linear models do not cover steps, phases and finds."
        ),
        Table.of(
            [data],
            {
                Column("crossover", "rad/s"): "crossover_rad_s",
                Column("phase margin", "deg"): "phase_margin_deg",
                Column("delay margin", "s"): "delay_margin_s",
                Column("delay margin", "ticks"): "delay_margin_ticks",
                Column("gain margin", "dB"): "gain_margin_db",
                Column("lost by sampling", "deg"): "phase_lost_deg",
            },
            f"With a tick of {number(1e3 * data.tick_s)} ms",
        ),
    ]


HEADING_LOOP = Part[HeadingLoopMargins](
    "heading_loop",
    "The loop of the heading",
    _heading_loop,
    _show_heading,
    criteria=(
        Criterion(
            "phase margin of the heading", "deg", "at least", 45.0,
            "it turns to its heading without swinging",
            "it swings about its heading",
            _USUAL,
            lambda data: data.phase_margin_deg,
        ),
        Criterion(
            "gain margin of the heading", "dB", "at least", 6.0,
            "the motors may be twice as strong",
            "motors of less than twice the nominal strength make it unstable",
            _USUAL,
            lambda data: data.gain_margin_db,
        ),
        Criterion(
            "delay margin of the heading", "ticks", "at least", 4.0,
            "it tolerates more added ticks of delay than the threshold",
            "fewer added ticks of delay than the threshold make it oscillate",
            "set by this project",
            lambda data: data.delay_margin_ticks,
        ),
    ),
)  # fmt: skip
