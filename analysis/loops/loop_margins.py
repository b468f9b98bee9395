"""Computes stability margins of a loop: gain, phase, modulus, disk and delay margins.

Crossovers and peaks are computed from the matrices of the loop (module
``frequency_levels``), in continuous and in sampled time. A frequency grid alone could
miss a crossover or a peak between two of its points or outside the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.frequency_levels import (
    SEARCH_POINTS,
    crossings,
    level_frequencies,
    peak,
    with_middles,
)
from analysis.loops.linear_models import LinearModel
from analysis.loops.margin_results import (
    SKEWS,
    DiskMargin,
    LoopMargins,
    complementary,
    loop_grid,
)
from analysis.loops.open_loops import (
    BREAK_POINTS,
    DIRECTIONS,
    BreakPoint,
    Direction,
    open_loop,
)
from analysis.loops.operating_points import OperatingPoint
from systems.framework.input_error import InputError

#: If |L| is below this at all frequencies, no signal comes back, and there is no loop.
_NO_LOOP = 1e-9


def is_loop(model: LinearModel) -> bool:
    """Returns whether |L| is larger than rounding errors at some frequency.

    Otherwise, no signal comes back to the cut, and there is no loop.
    """
    omega = loop_grid(model, SEARCH_POINTS)
    return bool(np.abs(model.response(omega)[0, 0]).max() > _NO_LOOP)


def loop_margins(model: LinearModel) -> LoopMargins:
    """Computes all margins of a loop transfer function L under negative feedback.

    Raises InputError if L does not have exactly one input and one output.
    """
    if model.B.shape[1] != 1 or model.C.shape[0] != 1:
        raise InputError(
            f"{model.name}",
            f"has {model.B.shape[1]} inputs and {model.C.shape[0]} outputs; margins "
            "need exactly one loop; select one with LinearModel.part",
        )
    T = complementary(model)
    if not T.stable:
        return LoopMargins(model.name, model)
    omega = loop_grid(model, SEARCH_POINTS)
    upper, lower = _gain_margins(model, T, omega)
    lag, lead, crossover, delay, late = _phase_margins(model, T, omega)
    # S = 1 - T. The size of the disk is the smallest 1/|S + (skew - 1)/2|.
    peaks = [peak(T, (1.0 + skew) / 2.0) for skew in SKEWS]
    disks = tuple(
        DiskMargin(skew, 1.0 / largest if largest > 0.0 else math.inf, where)
        for skew, (largest, where) in zip(SKEWS, peaks, strict=True)
    )
    largest_T, (largest_S, where) = peaks[0][0], peaks[-1]
    return LoopMargins(
        name=model.name,
        model=model,
        stable=True,
        gain_increase_margin=upper,
        gain_reduction_margin=lower,
        phase_lag_margin_deg=math.degrees(lag),
        phase_lead_margin_deg=math.degrees(lead),
        crossover_rad_s=crossover,
        delay_margin_s=delay,
        delay_frequency_rad_s=late,
        modulus_margin=1.0 / largest_S,
        modulus_frequency_rad_s=where,
        sensitivity_peak=largest_S,
        complementary_peak=largest_T,
        disks=disks,
    )


def _gain_margins(
    model: LinearModel, T: LinearModel, omega: NDArray[np.float64]
) -> tuple[float, float]:
    """Smallest gain factor above 1, and largest below 1, that destabilize the loop."""
    # L is real at the frequencies at which T is real.
    found = with_middles(np.concatenate((omega, level_frequencies(T, 0.0, -1j, 0.0))))
    at = crossings(found, lambda w: model.response(w)[0, 0].imag)
    values = list(model.response(at)[0, 0].real) if at else []
    # L is also real at both ends of the frequency range. At zero frequency, an
    # integrating loop has T = 1 and infinite L. This end is left out, because no gain
    # makes L equal to -1 there.
    ends = [0.0, math.pi / T.period_s] if T.period_s else [0.0]
    values += [
        t / (1.0 - t) for t in T.response(ends)[0, 0].real if abs(1.0 - t) > _NO_LOOP
    ]
    values += [] if T.period_s else [float(model.D[0, 0])]
    return gain_factors(values)


def gain_factors(values: Iterable[float]) -> tuple[float, float]:
    """Smallest factor of at least 1, and largest below 1, that destabilizes a loop.

    ``values`` are those of L at the frequencies at which L is real.
    """
    upper, lower = math.inf, 0.0
    for value in values:
        if value < -_NO_LOOP:
            gain = -1.0 / value
            if gain >= 1.0:
                upper = min(upper, gain)
            elif gain > _NO_LOOP:
                lower = max(lower, gain)
    return upper, lower


def _phase_margins(
    model: LinearModel, T: LinearModel, omega: NDArray[np.float64]
) -> tuple[float, float, float, float, float]:
    """Margins of phase lag, phase lead and delay, with the crossovers behind them.

    In this order: phase lag, rad, phase lead, rad, crossover of the smaller of both,
    rad/s, delay, s, and its crossover, rad/s.
    """
    # |L| = 1 where the real part of T is 1/2.
    found = with_middles(np.concatenate((omega, level_frequencies(T, 0.0, 1.0, -1.0))))
    at = crossings(found, lambda w: np.abs(model.response(w)[0, 0]) - 1.0)
    lag, lead, where, delay, late = phases_at(
        at, model.response(at)[0, 0] if at else ()
    )
    if not model.period_s and abs(model.D[0, 0]) >= 1.0:
        # |L| stays at 1 or above at high frequencies, where any delay destabilizes.
        delay, late = 0.0, math.inf
    return lag, lead, where, delay, late


def phases_at(
    crossovers: Iterable[float], values: Iterable[complex]
) -> tuple[float, float, float, float, float]:
    """Margins as of ``_phase_margins``, from gain crossovers and the values of L."""
    lag, lead, where, delay, late = math.inf, math.inf, math.nan, math.inf, math.nan
    for w, L in zip(crossovers, values, strict=True):
        behind = float(np.angle(-L)) % math.tau  # lag that turns L to -1
        ahead = math.tau - behind
        if min(behind, ahead) < min(lag, lead):
            where = w
        lag, lead = min(lag, behind), min(lead, ahead)
        if behind / w < delay:
            delay, late = behind / w, w
    return lag, lead, where, delay, late


@dataclass(frozen=True)
class PointMargins:
    """Margins of one cut loop at an operating point."""

    at: BreakPoint
    direction: Direction
    margins: LoopMargins
    """Margins of this loop, while the loop of the other direction is closed."""


def all_margins(point: OperatingPoint) -> tuple[PointMargins, ...]:
    """Computes the stability margins with the loop cut at sensor, actuator and wheels.

    Each cut gives two loops: along the line to the source, and across this line. A loop
    in which no signal comes back is left out. For example, without a push of an
    obstacle, no force acts across the line at the follow distance.
    """
    found = []
    for at in BREAK_POINTS:
        for direction in DIRECTIONS:
            model = open_loop(point, at, direction)
            if is_loop(model):
                found.append(PointMargins(at, direction, loop_margins(model)))
    return tuple(found)
