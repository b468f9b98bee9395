"""Margins of a loop that is given as a frequency response, or has a pure delay.

Such a loop has no matrices. Crossovers and peaks are therefore sought between the
points of a frequency grid, and stability follows from the Nyquist criterion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar

from analysis.loops.frequency_levels import crossings, frequency_grid
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import gain_factors, phases_at
from analysis.loops.margin_results import (
    SKEWS,
    DiskMargin,
    FrequencyResponse,
    LoopMargins,
)
from systems.framework.input_error import InputError

#: Largest change of the phase of L between two points of measured data, rad.
_LARGEST_TURN = math.pi / 2.0
#: Smallest number of frequencies of measured data.
_FEWEST = 4
#: |L| below which the response counts as zero at the end of the frequencies.
_END = 0.5
#: Largest distance of the phase at the first frequency from that of its asymptote, rad.
_BEGIN = math.pi / 6.0
#: Largest distance of the slope of log |L| at the first frequency from a whole number.
_SLOPE = 0.15
#: |Im L / Re L| below which the first value of L counts as that of zero frequency.
_REAL = 0.05
#: Points of the grid per radian of delay.
_PER_RADIAN = 20.0
#: |L| below which a delayed response is not searched.
_SMALL = 1e-3
#: Largest number of points of the grid of a delayed response.
_MOST_POINTS = 2_000_000
#: Number of the highest points of the grid around which a peak is refined.
_PEAKS = 5

Response = Callable[[NDArray[np.float64]], NDArray[np.complex128]]


@dataclass(frozen=True)
class LoopResponse:
    """Loop transfer function L as a function of frequency."""

    name: str
    omega: NDArray[np.float64]
    """(n,) ascending frequencies, rad/s, dense enough to show every crossover."""
    at: Response
    """Returns L at (k,) frequencies, rad/s."""


def measured_response(
    data: Any, unstable_poles: int, delay_s: float
) -> tuple[LoopResponse, bool]:
    """Reads a ``control.FrequencyResponseData`` with one input and one output.

    Between the points, the logarithm of |L| and the phase are interpolated over the
    logarithm of the frequency (monotone cubic).

    Args:
        data: The response L.
        unstable_poles: Number of poles of L that grow. Data cannot tell it.
        delay_s: Pure delay in addition to that of the data, s.

    Returns:
        The response, and whether the closed loop is stable.

    Raises:
        InputError: The data have several inputs or outputs, are not finite, or do not
            decide whether the closed loop is stable.
    """
    omega, values = measured_samples(data)
    if values.shape[:2] != (1, 1):
        raise InputError(
            "loop",
            f"has {values.shape[1]} inputs and {values.shape[0]} outputs; choose one "
            "of each, for example loop[0, 0]",
        )
    L = values[0, 0]
    if not np.abs(L).min() > 0.0:
        raise InputError("loop", "is 0 at a frequency; leave this frequency out")
    refuse_gaps(omega, L)
    logarithm = np.log(np.abs(L)) + 1j * np.unwrap(np.angle(L))
    real = PchipInterpolator(np.log(omega), logarithm.real)
    phase = PchipInterpolator(np.log(omega), logarithm.imag)

    def at(w: NDArray[np.float64]) -> NDArray[np.complex128]:
        x = np.log(w)
        return np.asarray(np.exp(real(x) + 1j * (phase(x) - w * delay_s)))

    turning = turning_grid(_end(omega, np.abs(L), _SMALL), delay_s)
    turning = turning[(turning > omega[0]) & (turning < omega[-1])]
    even = np.geomspace(omega[0], omega[-1], 5_000)
    dense = np.unique(np.concatenate([omega, even, turning]))
    response = LoopResponse(getattr(data, "name", None) or "loop", dense, at)
    return response, nyquist_stable(dense, at(dense), unstable_poles)


def measured_samples(
    data: Any,
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Reads a ``control.FrequencyResponseData``.

    Returns (k,) ascending frequencies above 0, rad/s, and the (p, m, k) values. Raises
    InputError if there are too few, or if values are not finite.
    """
    order = np.argsort(data.omega)
    order = order[np.asarray(data.omega)[order] > 0.0]
    omega = np.asarray(data.omega, dtype=float)[order]
    L = np.asarray(data.frdata)[:, :, order].astype(complex)
    if len(omega) < _FEWEST or not np.isfinite(L).all():
        raise InputError(
            "loop",
            f"needs at least {_FEWEST} frequencies above 0, with finite values",
        )
    return omega, L


def response_period(data: Any) -> float | None:
    """Period of a sampled frequency response, s; None if it is continuous."""
    if data.dt is True:
        raise InputError(
            "loop", "is sampled with an unknown period (dt=True); state dt in s"
        )
    return float(data.dt) if data.dt else None


def refuse_gaps(omega: NDArray[np.float64], L: NDArray[np.complex128]) -> None:
    """Raises InputError if the phase of (k,) values L turns too far between two."""
    turns = np.abs(np.angle(L[1:] / L[:-1]))
    if turns.max() > _LARGEST_TURN:
        k = int(turns.argmax())
        raise InputError(
            "loop",
            f"turns by {math.degrees(turns[k]):.0f} deg from {omega[k]:.4g} to "
            f"{omega[k + 1]:.4g} rad/s; give more points there",
        )


def nyquist_stable(
    omega: NDArray[np.float64], L: NDArray[np.complex128], unstable_poles: int
) -> bool:
    """Whether a loop is stable, by the Nyquist criterion.

    For a stable loop, arg(1 + L) grows by pi P + n pi/2 over all frequencies. P is the
    number of growing poles of L, and n the number of its integrators.
    """
    slope = math.log(abs(L[1] / L[0])) / math.log(omega[1] / omega[0])
    integrators = max(round(-slope), 0)
    angle = np.unwrap(np.angle(1.0 + L))
    # Just above zero frequency, 1 + L is on an axis.
    first = -integrators * math.pi / 2.0
    first += math.pi * round((angle[0] - first) / math.pi)
    if abs(angle[0] - first) > _BEGIN or abs(slope + integrators) > _SLOPE:
        raise InputError(
            "loop",
            f"begins too late at {omega[0]:.4g} rad/s: magnitude and phase have not "
            "reached those of low frequencies; add lower frequencies",
        )
    if abs(L[-1]) > _END:
        raise InputError(
            "loop",
            f"ends too early: |L| is {abs(L[-1]):.3g} at {omega[-1]:.4g} rad/s, and "
            f"must fall below {_END:g}; add higher frequencies",
        )
    last = math.tau * round(angle[-1] / math.tau)
    turns = (last - first) / (math.pi / 2.0)
    return round(turns) == 2 * unstable_poles + integrators


def delayed_response(model: LinearModel, delay_s: float) -> tuple[LoopResponse, bool]:
    """Returns a continuous model with a pure delay, and whether its loop is stable.

    Stability follows by counting (Walton and Marshall 1987): as the delay grows, poles
    of the closed loop cross the imaginary axis only at gain crossovers, to the right
    where |L| falls with frequency, and to the left where it rises.

    Raises InputError if |L| exceeds 1 at infinite frequency, or if the frequency grid
    would be too large.
    """
    top = abs(float(model.D[0, 0]))
    if top >= 1.0:
        raise InputError(
            "delay_s",
            f"makes {model.name} unstable, however small it is, because |L| is "
            f"{top:.3g} at infinite frequency; add the lag of the actuator or sensor",
        )

    def at(w: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.asarray(model.response(w)[0, 0] * np.exp(-1j * w * delay_s))

    coarse = frequency_grid(model.poles, None)
    size = np.abs(model.response(coarse)[0, 0])
    end = _end(coarse, size, max(_SMALL, 1.01 * top))
    omega = np.unique(
        np.concatenate([coarse[coarse <= end], turning_grid(end, delay_s)])
    )
    return LoopResponse(model.name, omega, at), stable_with_delay(model, delay_s)


def _end(omega: NDArray[np.float64], size: NDArray[np.float64], least: float) -> float:
    """Frequency beyond which (k,) sizes stay below a limit, rad/s."""
    last = int(np.flatnonzero(size > least).max(initial=0))
    return float(omega[min(last + 1, len(omega) - 1)])


def turning_grid(end: float, delay_s: float) -> NDArray[np.float64]:
    """Frequencies up to ``end``, rad/s, between which a delay turns by little.

    Raises InputError if these are too many.
    """
    count = max(2, math.ceil(end * delay_s * _PER_RADIAN))
    if count > _MOST_POINTS:
        raise InputError(
            "delay_s",
            f"is {delay_s:g} s, which turns the phase too often up to {end:.3g} rad/s, "
            "where the loop still acts; state a shorter delay",
        )
    return np.linspace(0.0, end, count)[1:]


def stable_with_delay(model: LinearModel, delay_s: float) -> bool:
    """Whether the loop of a continuous model with a pure delay is stable."""
    closed_A = model.A - model.B @ model.C / (1.0 + model.D[0, 0])
    growing = int((np.linalg.eigvals(closed_A).real >= 0.0).sum())
    omega = frequency_grid(
        np.concatenate([model.poles, np.linalg.eigvals(closed_A)]), None
    )

    def excess(w: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.abs(model.response(w)[0, 0]) - 1.0)

    for w in crossings(omega, excess):
        lag = float(np.angle(-model.response([w])[0, 0, 0])) % math.tau
        times = math.floor((delay_s * w - lag) / math.tau) + 1
        near = excess(np.array([w * (1 - 1e-6), w * (1 + 1e-6)]))
        growing += (2 if near[1] < near[0] else -2) * max(times, 0)
    return growing == 0


def response_margins(response: LoopResponse, *, stable: bool) -> LoopMargins:
    """Computes all margins of a loop that is given as a frequency response."""
    omega = response.omega
    drawn = FrequencyResponse(omega, response.at(omega))
    if not stable:
        return LoopMargins(response.name, drawn)
    real = crossings(omega, lambda w: response.at(w).imag)
    values = [float(response.at(np.array([w]))[0].real) for w in real]
    if abs(np.tan(np.angle(drawn.L[0]))) < _REAL:  # L is real at zero frequency
        values.append(float(drawn.L[0].real))
    upper, lower = gain_factors(values)
    at = crossings(omega, lambda w: np.abs(response.at(w)) - 1.0)
    lag, lead, where, delay, late = phases_at(
        at, response.at(np.array(at)) if at else ()
    )
    disks = tuple(response_disk(response, skew) for skew in SKEWS)
    modulus = disks[SKEWS.index(1.0)]
    complementary = disks[SKEWS.index(-1.0)]
    return LoopMargins(
        response.name,
        drawn,
        stable=True,
        gain_increase_margin=upper,
        gain_reduction_margin=lower,
        phase_lag_margin_deg=math.degrees(lag),
        phase_lead_margin_deg=math.degrees(lead),
        crossover_rad_s=where,
        delay_margin_s=delay,
        delay_frequency_rad_s=late,
        modulus_margin=modulus.alpha,
        modulus_frequency_rad_s=modulus.frequency_rad_s,
        sensitivity_peak=1.0 / modulus.alpha,
        complementary_peak=1.0 / complementary.alpha,
        disks=disks,
    )


def response_disk(response: LoopResponse, skew: float) -> DiskMargin:
    """Computes the disk margin of a stable loop: the least 1/|S + (skew - 1)/2|."""
    omega = response.omega

    def size(w: Any) -> Any:
        S = 1.0 / (1.0 + response.at(np.atleast_1d(w)))
        return np.abs(S + (skew - 1.0) / 2.0)

    values = size(omega)
    best, at = float(values.max()), float(omega[int(values.argmax())])
    for k in np.argsort(values)[-_PEAKS:]:
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
        found = minimize_scalar(
            lambda w: -float(size(w)[0]), bounds=(low, high), method="bounded"
        )
        if -found.fun > best:
            best, at = float(-found.fun), float(found.x)
    return DiskMargin(skew, 1.0 / best, at)
