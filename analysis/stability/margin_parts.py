"""Part of the stability report about the stability margins of the loops."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.design.requirements import REQUIRED
from analysis.linear.gang_of_four import GangOfFour, gang_of_four
from analysis.linear.linear_plots import (
    plot_bode,
    plot_gang_of_four,
    plot_nichols,
    plot_nyquist,
)
from analysis.linear.loop_margins import (
    DiskMargin,
    LoopMargins,
    PointMargins,
    all_margins,
    loop_margins,
)
from analysis.models.linear_models import LinearModel
from analysis.models.open_loops import BREAK_POINTS, target_loop
from analysis.models.operating_points import OperatingPoint
from analysis.reporting.criterion import Criterion, Reading
from analysis.reporting.plain_values import pick
from analysis.reporting.section import Cell, Column, Content, Figure, Table, number
from analysis.stability.law_analysis import Part, Study

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
#: Place and direction of the cut loop that represents the implemented loop.
_MAIN = ("sensor", "along")


@dataclass(frozen=True)
class Margins:
    """Stability margins of the ideal target loop and of the implemented loop.

    The target loop contains the attraction alone, without motor lag, sampling, and
    obstacles. The implemented loop is the loop of the built diagram.
    """

    target: dict[str, LoopMargins]
    """Margins of the target loop, by the place of the cut."""
    target_model: LinearModel
    """Linear model of the target loop, cut at the sensor."""
    implemented: tuple[PointMargins, ...]
    gangs: tuple[GangOfFour, ...]
    """Gang of four of each loop that is cut at the sensor."""
    at: OperatingPoint

    def implemented_at(self, at: str, direction: str) -> LoopMargins | None:
        """Returns the stability margins of one cut, or None if there is no such loop.

        The cut is at the ``sensor``, at the ``actuator``, or at the ``wheels``. The
        direction of the motion is ``along`` the line to the source, or ``across`` it.
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
    """Returns the pole with the least damping ratio among all slow oscillations, 1/s.

    If nothing oscillates slowly, the function returns the pole with the largest real
    part. Of a conjugate pair, it returns the pole with the positive imaginary part.
    ``poles`` has the shape (n,) and the unit 1/s (s plane).
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
            "margins": {at: _margin_document(m) for at, m in data.target.items()},
        },
        "implemented_loop": {
            "cut_at": sensor.name,
            **_loop_document(data.at.eigenvalues, sensor),
            "margins": {
                f"{found.at}_{found.direction}": _margin_document(found.margins)
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


def _margin_document(margins: LoopMargins) -> dict[str, Any]:
    return pick(
        margins, "stable", "gain_increase_margin", "gain_reduction_margin",
        "gain_margin_db", "phase_lag_margin_deg", "phase_lead_margin_deg",
        "crossover_rad_s", "phase_margin_deg", "delay_margin_s", "modulus_margin",
        "modulus_frequency_rad_s", "sensitivity_peak", "complementary_peak", "disks",
    )  # fmt: skip


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


def _worst(
    worst: Callable[[list[float]], float], of: Callable[[LoopMargins], float]
) -> Callable[[Margins], Reading]:
    """Reads the worst value over all places of the cut and both directions."""
    return lambda data: (
        worst([of(each.margins) for each in data.implemented])
        if data.implemented
        else math.nan
    )


MARGINS = Part[Margins](
    "margins",
    "Margins",
    _margins,
    _show,
    criteria=(
        Criterion(
            "least phase margin", "deg", "at least", REQUIRED.phase_margin_deg,
            "every cut loop tolerates the usual extra phase lag or lead",
            "a small extra phase makes the loop oscillate",
            "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)",
            _worst(min, lambda margins: margins.phase_margin_deg),
        ),
        Criterion(
            "least gain margin", "dB", "at least", REQUIRED.gain_margin_db,
            "gains may double, or fall to half",
            "a gain that is off by less than a factor of two, up or down, makes it "
            "unstable",
            "usual: 6 dB and 45 deg (Seiler, Packard and Gahinet 2020)",
            _worst(min, lambda margins: margins.gain_margin_db),
        ),
        Criterion(
            "largest sensitivity peak", "", "at most", REQUIRED.sensitivity_peak,
            "disturbances are hardly amplified",
            "disturbances near the crossover are amplified more than twice",
            "usual: M_s of 1.2 to 2.0 (Astrom and Murray)",
            _worst(max, lambda margins: margins.sensitivity_peak),
        ),
        Criterion(
            "least disk margin", "", "at least", REQUIRED.disk_margin,
            "gain and phase may change at once, by 6 dB and 37 deg",
            "a change of gain and phase at once makes the loop oscillate early",
            "alpha = 2/3: 6 dB in each direction (Seiler, Packard and Gahinet 2020)",
            _worst(min, lambda margins: margins.disk.alpha),
        ),
    ),
    document=_document,
    models=lambda data: (data.target_model,),
    fresh=True,
)  # fmt: skip
