"""Margins of a loop: gain, phase, modulus, disk, and delay at its crossovers.

Crossovers and peaks come from the loop's matrices (``frequency_levels``), in
continuous time or sampled alike, so none is missed between two points of a grid or
beyond its ends. Gain and phase count in both directions: a loop whose plant is
unstable without feedback is lost by too little gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.linear.frequency_levels import (
    GRID_POINTS,
    SEARCH_POINTS,
    crossings,
    frequency_grid,
    level_frequencies,
    peak,
    with_middles,
)
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

#: Skews of the disks: guards gain reduction, both alike, gain increase.
SKEWS = (-1.0, 0.0, 1.0)
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
        if self.alpha == math.inf:
            return math.inf
        squared = self.alpha**2
        cosine = 4.0 - squared * (1.0 + self.skew**2)
        cosine /= 4.0 + squared * (1.0 - self.skew**2)
        return math.degrees(math.acos(cosine)) if cosine > -1.0 else math.inf

    @property
    def _ends(self) -> tuple[float, float]:
        """Where the disk of factors meets the real axis."""
        if self.alpha == math.inf:
            return -math.inf, math.inf
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
    model: LinearModel = field(repr=False)
    """L."""

    @cached_property
    def response(self) -> FrequencyResponse:
        """For pictures."""
        return frequency_response(self.model)

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
    """Response of a loop over all frequencies that count, for pictures."""
    omega = _grid(model, GRID_POINTS)
    return FrequencyResponse(omega, model.response(omega)[0, 0])


def _grid(model: LinearModel, points: int) -> NDArray[np.float64]:
    """Frequencies with the modes of the open and of the closed loop."""
    poles = np.concatenate((model.poles, np.linalg.eigvals(_closed_matrix(model))))
    return frequency_grid(poles, model.period_s, points=points)


def is_loop(model: LinearModel) -> bool:
    """Whether anything comes back: a response of rounding errors has no margins."""
    omega = _grid(model, SEARCH_POINTS)
    return bool(np.abs(model.response(omega)[0, 0]).max() > _NO_LOOP)


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
            f"has {model.B.shape[1]} inputs and {model.C.shape[0]} outputs; margins "
            "need exactly one loop; select one with LinearModel.part",
        )
    if not _closed_is_stable(model):
        return _nothing(model)
    T = _complementary(model)
    omega = _grid(model, SEARCH_POINTS)
    upper, lower = _gain_margins(model, T, omega)
    lag, lead, crossover, delay = _phase_margins(model, T, omega)
    # S = 1 - T, and the disk of a skew is the least of 1/|S + (skew - 1)/2|.
    peaks = [peak(T, (1.0 + skew) / 2.0) for skew in SKEWS]
    disks = tuple(
        DiskMargin(skew, 1.0 / largest if largest > 0.0 else math.inf, where)
        for skew, (largest, where) in zip(SKEWS, peaks, strict=True)
    )
    largest_T, (largest_S, where) = peaks[0][0], peaks[-1]
    return LoopMargins(
        name=model.name,
        stable=True,
        gain_increase_margin=upper,
        gain_reduction_margin=lower,
        phase_lag_margin_deg=math.degrees(lag),
        phase_lead_margin_deg=math.degrees(lead),
        crossover_rad_s=crossover,
        delay_margin_s=delay,
        modulus_margin=1.0 / largest_S,
        modulus_frequency_rad_s=where,
        sensitivity_peak=largest_S,
        complementary_peak=largest_T,
        disks=disks,
        model=model,
    )


def _nothing(model: LinearModel) -> LoopMargins:
    """Of a closed loop that is unstable."""
    return LoopMargins(
        name=model.name,
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
        model=model,
    )


def _closed_matrix(model: LinearModel) -> NDArray[np.float64]:
    """(n, n) A of the closed loop."""
    return model.A - model.B @ model.C / (1.0 + model.D[0, 0])


def _closed_is_stable(model: LinearModel) -> bool:
    poles = np.linalg.eigvals(_closed_matrix(model))
    if model.period_s:
        return bool((np.abs(poles) < 1.0).all())
    return bool((poles.real < 0.0).all())


def _complementary(model: LinearModel) -> LinearModel:
    """T = L/(1 + L); it has no poles on the border where the loop is stable."""
    share = 1.0 / (1.0 + model.D[0, 0])
    return replace(
        model,
        A=_closed_matrix(model),
        B=share * model.B,
        C=share * model.C,
        D=share * model.D,
    )


def _gain_margins(
    model: LinearModel, T: LinearModel, omega: NDArray[np.float64]
) -> tuple[float, float]:
    """Least factor above 1, and greatest below, that puts a pole on the border."""
    # L is real where T is.
    found = with_middles(np.concatenate((omega, level_frequencies(T, 0.0, -1j, 0.0))))
    at = crossings(found, lambda w: model.response(w)[0, 0].imag)
    values = list(model.response(at)[0, 0].real) if at else []
    # At both ends of the border L is real, too. T tells a loop that integrates, and
    # is without end at rest: no gain above 0 is too small.
    ends = [0.0, math.pi / T.period_s] if T.period_s else [0.0]
    values += [
        t / (1.0 - t) for t in T.response(ends)[0, 0].real if abs(1.0 - t) > _NO_LOOP
    ]
    values += [] if T.period_s else [float(model.D[0, 0])]
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
) -> tuple[float, float, float, float]:
    """Least lag and lead, rad, where the lesser is, rad/s, and least delay, s."""
    # |L| = 1 where the real part of T is a half.
    found = with_middles(np.concatenate((omega, level_frequencies(T, 0.0, 1.0, -1.0))))
    at = crossings(found, lambda w: np.abs(model.response(w)[0, 0]) - 1.0)
    lag, lead, where, delay = math.inf, math.inf, math.nan, math.inf
    for w, L in zip(at, model.response(at)[0, 0] if at else (), strict=True):
        behind = float(np.angle(-L)) % math.tau  # lag that leads to -1
        ahead = math.tau - behind
        if min(behind, ahead) < min(lag, lead):
            where = w
        lag, lead = min(lag, behind), min(lead, ahead)
        delay = min(delay, behind / w)
    if not model.period_s and abs(model.D[0, 0]) >= 1.0:
        # Crossovers without end: no delay is short enough.
        delay = 0.0
    return lag, lead, where, delay


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
