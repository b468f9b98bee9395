"""Margins of a loop: gain, phase, modulus, disk, and delay at its crossovers.

All are read off the frequency response, with crossovers and peaks refined
between the points of the grid, in continuous time or sampled alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from analysis.stability.linear_models import LinearModel
from analysis.stability.open_loops import (
    BREAK_POINTS,
    DIRECTIONS,
    BreakPoint,
    Direction,
    open_loop,
)
from analysis.stability.operating_points import OperatingPoint

__all__ = [
    "SKEWS",
    "DiskMargin",
    "FrequencyResponse",
    "LoopMargins",
    "PointMargins",
    "all_margins",
    "frequency_response",
    "loop_margins",
]

#: Skews of the disks: guards gain reduction, both alike, gain increase.
SKEWS = (-1.0, 0.0, 1.0)
#: Points of a frequency grid.
_POINTS = 1500
#: Lowest and highest frequency, rad/s; a sampled loop ends at its Nyquist frequency.
_LOWEST, _HIGHEST = 1e-3, 1e3
#: A frequency that counts as none, rad/s.
_AT_REST = 1e-6
#: A response below this everywhere is no loop.
_NO_LOOP = 1e-9


@dataclass(frozen=True)
class FrequencyResponse:
    """A loop and its gang of four over frequency."""

    omega: NDArray[np.float64]
    """(n,) rad/s."""
    L: NDArray[np.complex128]
    """(n,) loop transfer function."""

    @property
    def S(self) -> NDArray[np.complex128]:
        """Sensitivity 1 / (1 + L)."""
        return 1.0 / (1.0 + self.L)

    @property
    def T(self) -> NDArray[np.complex128]:
        """Complementary sensitivity L / (1 + L)."""
        return self.L / (1.0 + self.L)


@dataclass(frozen=True)
class DiskMargin:
    """The largest disk of gain and phase changes that the loop stands."""

    skew: float
    """Of the disk: 0 for gain and phase changes alike to both sides."""
    alpha: float
    """Size of the disk."""
    gain_margin_db: float
    """Gain may change by this factor either way, dB."""
    phase_margin_deg: float
    """Phase may change by this much, deg."""
    frequency_rad_s: float
    """Where the loop is nearest to the disk, rad/s."""


@dataclass(frozen=True)
class LoopMargins:
    """How much a stable loop stands before it oscillates."""

    name: str
    """Of the loop."""
    stable: bool
    """Whether the closed loop is; without it margins say nothing."""
    gain_margin: float
    """Factor by which the gain may grow; infinite where any may."""
    gain_reduction_margin: float
    """Factor to which the gain may fall; 0 where it may vanish."""
    phase_margin_deg: float
    """Least phase change at a gain crossover, deg; infinite without one."""
    crossover_rad_s: float
    """The gain crossover of the phase margin, rad/s; not a number without one."""
    delay_margin_s: float
    """Least phase lag to -180 deg over frequency at a gain crossover, s. Exact
    in continuous time; see ``analysis.stability.delay_margin`` for sampled loops."""
    modulus_margin: float
    """Least distance of L from -1."""
    modulus_frequency_rad_s: float
    """Where that is, rad/s."""
    sensitivity_peak: float
    """M_s, largest |S|."""
    complementary_peak: float
    """M_t, largest |T|."""
    disks: tuple[DiskMargin, ...]
    """One for each of ``SKEWS``."""
    response: FrequencyResponse = field(repr=False)
    """For pictures."""

    @property
    def gain_margin_db(self) -> float:
        """The gain margin in dB."""
        return 20.0 * math.log10(self.gain_margin)

    @property
    def disk(self) -> DiskMargin:
        """The balanced disk."""
        return next(disk for disk in self.disks if disk.skew == 0.0)


def frequency_response(model: LinearModel) -> FrequencyResponse:
    """Response of a loop over all frequencies that count."""
    highest = math.pi / model.period_s if model.period_s else _HIGHEST
    omega = np.geomspace(_LOWEST, highest, _POINTS)
    return FrequencyResponse(omega, model.response(omega)[0, 0])


def loop_margins(model: LinearModel) -> LoopMargins:
    """All margins of a loop with one input and one output.

    Args:
        model: L, in the convention of negative feedback.

    Raises:
        ValueError: The model has several inputs or outputs.
    """
    if model.B.shape[1] != 1 or model.C.shape[0] != 1:
        raise ValueError(
            f"{model.name}: has {model.B.shape[1]} inputs and {model.C.shape[0]} "
            "outputs; margins are of one loop, take one by LinearModel.part"
        )
    response = frequency_response(model)

    def L(omega: float) -> complex:
        return complex(model.response([omega])[0, 0, 0])

    upper, lower = _gain_margins(response, L, model.period_s)
    phase, crossover, delay = _phase_margin(response, L)
    nearest, where = _minimum(response, L, lambda value: np.abs(1.0 + value))
    peak_T, _ = _minimum(response, L, lambda value: -np.abs(value / (1.0 + value)))
    return LoopMargins(
        name=model.name,
        stable=_closed_is_stable(model),
        gain_margin=upper,
        gain_reduction_margin=lower,
        phase_margin_deg=math.degrees(phase),
        crossover_rad_s=crossover,
        delay_margin_s=delay,
        modulus_margin=nearest,
        modulus_frequency_rad_s=where,
        sensitivity_peak=1.0 / nearest,
        complementary_peak=-peak_T,
        disks=tuple(_disk(model, response, L, skew) for skew in SKEWS),
        response=response,
    )


def _closed_is_stable(model: LinearModel) -> bool:
    gain = 1.0 / (1.0 + model.D[0, 0])
    poles = np.linalg.eigvals(model.A - model.B @ model.C * gain)
    if model.period_s:
        return bool((np.abs(poles) < 1.0).all())
    return bool((poles.real < 0.0).all())


def _zeros(
    omega: NDArray[np.float64],
    values: NDArray[np.float64],
    function: Callable[[float], float],
) -> Iterator[float]:
    """Where a function of frequency changes sign, between grid points."""
    for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        yield float(brentq(function, omega[k], omega[k + 1], xtol=1e-14, rtol=1e-13))


def _gain_margins(
    response: FrequencyResponse, L: Callable[[float], complex], period: float | None
) -> tuple[float, float]:
    upper, lower = math.inf, 0.0
    values = [
        L(omega)
        for omega in _zeros(response.omega, response.L.imag, lambda w: L(w).imag)
    ]
    at_rest = L(_AT_REST)
    if abs(at_rest.imag) < 1e-2 * abs(at_rest.real):
        values.append(at_rest)
    if period:
        values.append(L(math.pi / period))
    for value in values:
        if value.real < -_NO_LOOP:
            gain = -1.0 / value.real
            if gain >= 1.0:
                upper = min(upper, gain)
            else:
                lower = max(lower, gain)
    return upper, lower


def _phase_margin(
    response: FrequencyResponse, L: Callable[[float], complex]
) -> tuple[float, float, float]:
    """Phase margin, rad, its frequency, rad/s, and the least delay, s."""
    best, where, delay = math.inf, math.nan, math.inf
    size = np.abs(response.L) - 1.0
    for omega in _zeros(response.omega, size, lambda w: abs(L(w)) - 1.0):
        angle = float(np.angle(-L(omega)))  # 0 at -1
        if abs(angle) < best:
            best, where = abs(angle), omega
        delay = min(delay, (angle % math.tau) / omega)
    return best, where, delay


def _minimum(
    response: FrequencyResponse,
    L: Callable[[float], complex],
    function: Callable[[Any], Any],
) -> tuple[float, float]:
    """Least value of a function of L over the grid, refined about its place."""
    omega, values = response.omega, function(response.L)
    k = int(np.argmin(values))
    low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
    found = minimize_scalar(
        lambda w: float(function(L(w))),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-9 * high},
    )
    if found.fun < values[k]:
        return float(found.fun), float(found.x)
    return float(values[k]), float(omega[k])


def _disk(
    model: LinearModel,
    response: FrequencyResponse,
    L: Callable[[float], complex],
    skew: float,
) -> DiskMargin:
    """By ``control.disk_margins`` at the frequency where the disk is smallest."""
    import control

    def size(value: Any) -> Any:
        return -np.abs(1.0 / (1.0 + value) + (skew - 1.0) / 2.0)

    _, where = _minimum(response, L, size)
    alpha, gain_db, phase_deg = control.disk_margins(
        _as_control(model), np.array([where]), skew=skew
    )
    return DiskMargin(skew, float(alpha), float(gain_db), float(phase_deg), where)


def _as_control(model: LinearModel) -> Any:
    import control

    return control.ss(model.A, model.B, model.C, model.D, dt=model.period_s or 0)


@dataclass(frozen=True)
class PointMargins:
    """The margins of every cut loop at an operating point."""

    at: BreakPoint
    """Where the loop is cut."""
    direction: Direction
    """Along the line to the source, or across it."""
    margins: LoopMargins
    """Of that loop; the other direction is closed."""


def all_margins(point: OperatingPoint) -> tuple[PointMargins, ...]:
    """Margins at sensor, actuator and wheels, along and across.

    Loops that do not exist are left out: at the follow distance of a law that
    does not push, nothing pulls P to the side.
    """
    found = []
    for at in BREAK_POINTS:
        for direction in DIRECTIONS:
            model = open_loop(point, at, direction)
            if np.abs(frequency_response(model).L).max() > _NO_LOOP:
                found.append(PointMargins(at, direction, loop_margins(model)))
    return tuple(found)
