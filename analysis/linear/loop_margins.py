"""Margins of a loop: gain, phase, modulus, disk, and delay at its crossovers.

All are read off the frequency response, with crossovers and peaks refined
between the points of the grid, in continuous time or sampled alike. Gain and
phase count in both directions: a loop whose plant is unstable without feedback
is lost by too little gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from analysis.models.linear_models import LinearModel
from analysis.models.open_loops import (
    BREAK_POINTS,
    DIRECTIONS,
    BreakPoint,
    Direction,
    open_loop,
)
from analysis.models.operating_points import OperatingPoint
from systems.framework.input_error import InputError

__all__ = [
    "SKEWS",
    "DiskMargin",
    "FrequencyResponse",
    "LoopMargins",
    "PointMargins",
    "all_margins",
    "frequency_response",
    "is_loop",
    "loop_margins",
]

#: Skews of the disks: guards gain reduction, both alike, gain increase.
SKEWS = (-1.0, 0.0, 1.0)
#: Points of a frequency grid.
_POINTS = 1500
#: Further ones near the Nyquist frequency of a sampled loop.
_CLOSE = 300
#: Lowest and highest frequency, rad/s; a sampled loop ends at its Nyquist frequency.
_LOWEST, _HIGHEST = 1e-3, 1e3
#: A frequency that counts as none, rad/s.
_AT_REST = 1e-6
#: A response below this everywhere is no loop.
_NO_LOOP = 1e-9


@dataclass(frozen=True)
class FrequencyResponse:
    """A loop over frequency."""

    omega: NDArray[np.float64]
    """(n,) rad/s."""
    L: NDArray[np.complex128]
    """(n,) loop transfer function."""


@dataclass(frozen=True)
class DiskMargin:
    """The largest disk of gain and phase changes that the loop stands.

    L times any factor (1 + (1 - skew)/2 d)/(1 - (1 + skew)/2 d) with a complex
    |d| < alpha stays stable (Seiler, Packard and Gahinet 2020).
    """

    skew: float
    """Of the disk: 0 for gain and phase changes alike to both sides."""
    alpha: float
    """Size of the disk; 0 where the closed loop is unstable."""
    frequency_rad_s: float
    """Where the loop is nearest to the disk, rad/s."""

    def to_dict(self) -> dict[str, float]:
        """For the JSON document."""
        names = (
            "skew", "alpha", "gain_low", "gain_high", "gain_margin_db",
            "phase_margin_deg", "frequency_rad_s",
        )  # fmt: skip
        return {name: getattr(self, name) for name in names}

    @property
    def gain_low(self) -> float:
        """Factor to which the gain may fall; 0 where it may vanish."""
        return max(0.0, self._ends[0])

    @property
    def gain_high(self) -> float:
        """Factor to which the gain may grow; infinite where any may."""
        return self._ends[1]

    @property
    def gain_margin_db(self) -> float:
        """Gain may change by this much either way, dB: the lesser of both."""
        return _least_db(self.gain_low, self.gain_high)

    @property
    def phase_margin_deg(self) -> float:
        """Phase may change by this much either way, deg."""
        # Where |d| = alpha meets the factors exp(j phase).
        squared = self.alpha**2
        cosine = 4.0 - squared * (1.0 + self.skew**2)
        cosine /= 4.0 + squared * (1.0 - self.skew**2)
        return math.degrees(math.acos(cosine)) if cosine > -1.0 else math.inf

    @property
    def _ends(self) -> tuple[float, float]:
        """Where the disk of factors meets the real axis."""
        less, more = self.alpha * (1.0 - self.skew), self.alpha * (1.0 + self.skew)
        high = (2.0 + less) / (2.0 - more) if more < 2.0 else math.inf
        return (2.0 - less) / (2.0 + more), high


@dataclass(frozen=True)
class LoopMargins:
    """How much a loop stands before it is unstable.

    One that is unstable already stands nothing: factors 1, and 0 of all else.
    """

    name: str
    """Of the loop."""
    stable: bool
    """Whether the closed loop is."""
    gain_increase_margin: float
    """Factor below which the gain may grow; infinite where any may."""
    gain_reduction_margin: float
    """Factor above which the gain may fall; 0 where it may all but vanish."""
    phase_lag_margin_deg: float
    """Least lag at a gain crossover that is too much, deg; infinite without one."""
    phase_lead_margin_deg: float
    """Least lead at a gain crossover that is too much, deg; infinite without one."""
    crossover_rad_s: float
    """The gain crossover of the phase margin, rad/s; not a number without one."""
    delay_margin_s: float
    """Least phase lag to -180 deg over frequency at a gain crossover, s. Exact
    in continuous time; see ``analysis.linear.delay_margin`` for sampled loops."""
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
    def gain_increase_margin_db(self) -> float:
        """How far the gain may grow, dB."""
        return _least_db(0.0, self.gain_increase_margin)

    @property
    def gain_reduction_margin_db(self) -> float:
        """How far the gain may fall, dB; positive."""
        return _least_db(self.gain_reduction_margin, math.inf)

    @property
    def gain_margin_db(self) -> float:
        """Least change of the gain, up or down, that is too much, dB."""
        return _least_db(self.gain_reduction_margin, self.gain_increase_margin)

    @property
    def phase_margin_deg(self) -> float:
        """Least change of the phase, lag or lead, that is too much, deg."""
        return min(self.phase_lag_margin_deg, self.phase_lead_margin_deg)

    @property
    def disk(self) -> DiskMargin:
        """The balanced disk."""
        return next(disk for disk in self.disks if disk.skew == 0.0)


def _least_db(low: float, high: float) -> float:
    """The nearer end of an interval of gain factors about 1, dB."""
    down = 20.0 * math.log10(1.0 / low) if low > 0.0 else math.inf
    return min(down, 20.0 * math.log10(high))


def frequency_response(model: LinearModel) -> FrequencyResponse:
    """Response of a loop over all frequencies that count."""
    highest = math.pi / model.period_s if model.period_s else _HIGHEST
    omega = np.geomspace(_LOWEST, highest, _POINTS)
    if model.period_s:
        # Zeros near z = -1 turn the phase within the last thousandths.
        close = highest * (1.0 - np.geomspace(1e-2, 1e-7, _CLOSE))
        omega = np.sort(np.concatenate((omega, close)))
    return FrequencyResponse(omega, model.response(omega)[0, 0])


def is_loop(model: LinearModel) -> bool:
    """Whether anything comes back: a response of rounding errors has no margins."""
    return bool(np.abs(frequency_response(model).L).max() > _NO_LOOP)


def loop_margins(model: LinearModel) -> LoopMargins:
    """All margins of a loop with one input and one output.

    Args:
        model: L, in the convention of negative feedback.

    Raises:
        InputError: The model has several inputs or outputs.
    """
    if model.B.shape[1] != 1 or model.C.shape[0] != 1:
        raise InputError(
            f"{model.name}",
            f"has {model.B.shape[1]} inputs and {model.C.shape[0]} "
            "outputs; margins are of one loop, take one by LinearModel.part",
        )
    response = frequency_response(model)

    def L(omega: float) -> complex:
        return complex(model.response([omega])[0, 0, 0])

    if not _closed_is_stable(model):
        return _nothing(model.name, response)
    upper, lower = _gain_margins(response, L, model.period_s)
    lag, lead, crossover, delay = _phase_margins(response, L)
    nearest, where = _minimum(response, L, lambda value: np.abs(1.0 + value))
    peak_T, _ = _minimum(response, L, lambda value: -np.abs(value / (1.0 + value)))
    return LoopMargins(
        name=model.name,
        stable=True,
        gain_increase_margin=upper,
        gain_reduction_margin=lower,
        phase_lag_margin_deg=math.degrees(lag),
        phase_lead_margin_deg=math.degrees(lead),
        crossover_rad_s=crossover,
        delay_margin_s=delay,
        modulus_margin=nearest,
        modulus_frequency_rad_s=where,
        sensitivity_peak=1.0 / nearest,
        complementary_peak=-peak_T,
        disks=tuple(_disk(response, L, skew) for skew in SKEWS),
        response=response,
    )


def _nothing(name: str, response: FrequencyResponse) -> LoopMargins:
    """Of a closed loop that is unstable."""
    return LoopMargins(
        name=name,
        stable=False,
        gain_increase_margin=1.0,
        gain_reduction_margin=1.0,
        phase_lag_margin_deg=0.0,
        phase_lead_margin_deg=0.0,
        crossover_rad_s=math.nan,
        delay_margin_s=0.0,
        modulus_margin=0.0,
        modulus_frequency_rad_s=math.nan,
        sensitivity_peak=math.inf,
        complementary_peak=math.inf,
        disks=tuple(DiskMargin(skew, 0.0, math.nan) for skew in SKEWS),
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
    """Least factor above 1, and greatest below, that puts a pole on the border."""
    upper, lower = math.inf, 0.0
    values = [
        L(omega)
        for omega in _zeros(response.omega, response.L.imag, lambda w: L(w).imag)
    ]
    at_rest = L(_AT_REST)
    # A loop that integrates is without end at rest: no gain above 0 is too small.
    if abs(at_rest.imag) < 1e-2 * abs(at_rest.real) < 1e-2 / _NO_LOOP:
        values.append(at_rest)
    if period:
        values.append(L(math.pi / period))
    for value in values:
        if value.real < -_NO_LOOP:
            gain = -1.0 / value.real
            if gain >= 1.0:
                upper = min(upper, gain)
            elif gain > _NO_LOOP:
                lower = max(lower, gain)
    return upper, lower


def _phase_margins(
    response: FrequencyResponse, L: Callable[[float], complex]
) -> tuple[float, float, float, float]:
    """Least lag and lead, rad, where the lesser is, rad/s, and least delay, s."""
    lag, lead, where, delay = math.inf, math.inf, math.nan, math.inf
    size = np.abs(response.L) - 1.0
    for omega in _zeros(response.omega, size, lambda w: abs(L(w)) - 1.0):
        behind = float(np.angle(-L(omega))) % math.tau  # lag that leads to -1
        ahead = math.tau - behind
        if min(behind, ahead) < min(lag, lead):
            where = omega
        lag, lead = min(lag, behind), min(lead, ahead)
        delay = min(delay, behind / omega)
    return lag, lead, where, delay


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
    response: FrequencyResponse, L: Callable[[float], complex], skew: float
) -> DiskMargin:
    """alpha is the least of 1/|S + (skew - 1)/2| over frequency."""

    def size(value: Any) -> Any:
        return -np.abs(1.0 / (1.0 + value) + (skew - 1.0) / 2.0)

    largest, where = _minimum(response, L, size)
    return DiskMargin(skew, -1.0 / largest, where)


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
            if is_loop(model):
                found.append(PointMargins(at, direction, loop_margins(model)))
    return tuple(found)
