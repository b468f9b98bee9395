"""Part of the stability report about the stability margins of the loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from analysis.reporting.html_page import Cell, figure_html, number, paragraph, table
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
#: Fields of ``LoopMargins`` by the heading of their column.
_COLUMNS = {
    "gain up (dB)": "gain_increase_margin_db",
    "gain down (dB)": "gain_reduction_margin_db",
    "phase (deg)": "phase_margin_deg",
    "crossover (rad/s)": "crossover_rad_s",
    "modulus": "modulus_margin",
    "M_s": "sensitivity_peak",
    "M_t": "complementary_peak",
    "delay (s)": "delay_margin_s",
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
        """Returns the stability margins of the implemented loop for one cut.

        Args:
            at: Place of the cut: ``sensor``, ``actuator``, or ``wheels``.
            direction: Direction of the motion: ``along`` the line to the source, or
                ``across`` this line.

        Returns:
            The margins. If there is no such loop, None.
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
    """Returns the pole with the least damping ratio among all slow oscillations.

    If nothing oscillates slowly, the function returns the pole with the largest real
    part.

    Args:
        poles: (n,) poles in the s plane, 1/s.

    Returns:
        The pole in the s plane, 1/s. Of a conjugate pair, it is the pole with the
        positive imaginary part.
    """
    slow = poles[np.abs(poles) < _SLOW_RAD_S]
    swinging = slow[np.abs(slow.imag) > 1e-6]
    if len(swinging) == 0:
        return complex(poles[np.argmax(poles.real)])
    pole = complex(swinging[np.argmin(-swinging.real / np.abs(swinging))])
    return pole if pole.imag > 0.0 else pole.conjugate()


def margin_parts() -> tuple[Part, ...]:
    """Returns the part on margins of the target loop and of the implemented loop."""
    return (
        Part(
            "margins",
            "Margins",
            _margins,
            _render,
            fresh=True,
            document=_document,
            models=lambda data: (data.target_model,),
        ),
    )


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
    names = (
        "stable", "gain_increase_margin", "gain_reduction_margin", "gain_margin_db",
        "phase_lag_margin_deg", "phase_lead_margin_deg", "crossover_rad_s",
        "phase_margin_deg", "delay_margin_s", "modulus_margin",
        "modulus_frequency_rad_s", "sensitivity_peak", "complementary_peak", "disks",
    )  # fmt: skip
    return {name: getattr(margins, name) for name in names}


def _render(data: Margins, name: str) -> list[str]:
    rows: list[list[Cell]] = [["Ideal target loop: no lag, no sampling, no obstacle"]]
    rows += [_row(at, "along", margins) for at, margins in data.target.items()]
    tick_ms = 1e3 * data.at.loop.tick_s
    rows.append([f"Implemented loop, {tick_ms:g} ms, at the operating point"])
    rows += [_row(m.at, m.direction, m.margins) for m in data.implemented]
    headings = ["cut at", "direction", *_COLUMNS]
    loops = [m.margins for m in data.implemented]
    disks: list[list[Cell]] = [
        [m.at, m.direction, *_disk_cells(m.margins.disks)] for m in data.implemented
    ]
    return [
        paragraph(_EXPLANATION),
        table(headings, rows),
        table(
            [
                "cut at",
                "direction",
                *(f"skew {d.skew:+g}" for d in data.implemented[0].margins.disks),
            ],
            disks,
            caption="Disk margins: size alpha; range of the gain in dB; phase, plus or "
            "minus, in deg",
        ),
        figure_html(plot_bode(loops), f"{name}-bode", "Bode diagram with margins."),
        figure_html(
            plot_nyquist(loops),
            f"{name}-nyquist",
            "Nyquist curves, and the disk that they must not enter.",
        ),
        figure_html(plot_nichols(loops), f"{name}-nichols", "Nichols diagram."),
        *(
            figure_html(
                plot_gang_of_four(gang),
                f"{name}-gang-{gang.direction}",
                f"Gang of four, {gang.direction} the line to the source.",
            )
            for gang in data.gangs
        ),
    ]


def _row(at: str, direction: str, margins: LoopMargins) -> list[Cell]:
    return [at, direction, *(getattr(margins, name) for name in _COLUMNS.values())]


def _disk_cells(disks: Sequence[DiskMargin]) -> list[Cell]:
    return [
        f"{disk.alpha:.3f}; {_db(disk.gain_low)} to {_db(disk.gain_high)}; "
        f"{disk.phase_margin_deg:.1f}"
        for disk in disks
    ]


def _db(factor: float) -> str:
    return number(20.0 * math.log10(factor) if factor > 0.0 else -math.inf, 3)
