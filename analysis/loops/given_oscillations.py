"""Limit cycles of a loop with one nonlinearity, by its describing function."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from analysis.loops.frequency_levels import frequency_grid
from analysis.loops.given_loops import (
    Loop,
    as_linear_model,
    check_delay,
    delayed_model,
    is_response,
    refuse_place_without_diagram,
)
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import loop_margins
from analysis.loops.response_margins import (
    LoopResponse,
    delayed_response,
    measured_response,
    nyquist_stable,
    response_period,
    stable_with_delay,
)
from systems.framework.input_error import InputError

#: Amplitudes that are searched by default, in units of the input of the nonlinearity.
_AMPLITUDES = np.geomspace(1e-3, 1e3, 600)
#: Largest |1 + N L| of a solution.
_SOLVED = 1e-8
#: Relative step of the slopes that decide stability.
_STEP = 1e-5
#: Relative step to a larger amplitude, at which all poles must decay.
_LARGER = 1e-3
#: Solutions nearer to each other than this share are the same.
_SAME = 1e-4


@dataclass(frozen=True)
class PredictedCycle:
    """Oscillation of constant amplitude."""

    amplitude: float
    """Amplitude at the input of the nonlinearity, in the unit of this input."""
    frequency_rad_s: float
    stable: bool
    """Whether a slightly larger oscillation decays to this one and a slightly smaller
    one grows to it. An unstable cycle is the border between decay and growth."""


@dataclass(frozen=True)
class PredictedCycles:
    """All limit cycles that the describing function predicts."""

    name: str
    """Name of the loop."""
    cycles: tuple[PredictedCycle, ...]
    """In order of increasing amplitude."""

    def __str__(self) -> str:
        if not self.cycles:
            return f"{self.name}: no limit cycle predicted"
        lines = [
            f"{'stable' if each.stable else 'unstable'} limit cycle: amplitude "
            f"{each.amplitude:.4g}, {each.frequency_rad_s:.4g} rad/s"
            for each in self.cycles
        ]
        return "\n".join([f"{self.name}:", *lines])

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document."""
        names = ("amplitude", "frequency_rad_s", "stable")
        cycles = [{name: getattr(each, name) for name in names} for each in self.cycles]
        return {"name": self.name, "cycles": cycles}


def describing_function(
    loop: Loop,
    nonlinearity: Any,
    context: Any = None,
    port: Any = None,
    *,
    amplitudes: ArrayLike | None = None,
    delay_s: float = 0.0,
    unstable_poles: int = 0,
) -> PredictedCycles:
    """Predicts the limit cycles of a loop that contains one nonlinearity.

    The nonlinearity stands in front of L, with negative feedback. A limit cycle of
    amplitude A and frequency w satisfies 1 + N(A) L(jw) = 0, where N is the describing
    function: the ratio of the first harmonics of output and input. The prediction is
    accurate if L damps the higher harmonics well. The package ``control`` computes N
    and has the usual nonlinearities.

    Args:
        loop: Loop transfer function L with one input and one output, of the types of
            ``margins``.
        nonlinearity: A ``control.DescribingFunctionNonlinearity``, for example
            ``control.saturation_nonlinearity(1.0)``, or a function of one number
            without memory that is odd.
        context: Root context of the diagram; None: the default context. Only for
            diagrams.
        port: Input port inside the diagram, as for ``loop_at``. Only for diagrams.
        amplitudes: (n,) amplitudes between which cycles are sought, > 0, in the unit of
            the input of the nonlinearity. None: 600 from 0.001 to 1,000.
        delay_s: Pure delay in addition to that of the loop, s, >= 0.
        unstable_poles: Number of growing poles of L, needed only for a frequency
            response.

    Returns:
        The limit cycles, with their stability (growth rate as the amplitude changes).

    Raises:
        InputError: ``loop`` is not one loop, or the amplitudes are not positive.
        InputError: The delay is negative, or no whole number of periods.
    """
    check_delay(loop, delay_s)
    if is_response(loop):
        refuse_place_without_diagram(loop, context, port)
        given = _measured(loop, delay_s, unstable_poles)
    else:
        given = _modeled(as_linear_model(loop, context, port), delay_s)
    response = given.response
    sizes = np.unique(_AMPLITUDES if amplitudes is None else np.asarray(amplitudes))
    if len(sizes) < 2 or not sizes[0] > 0.0 or not np.isfinite(sizes).all():
        raise InputError(
            "amplitudes", "must be at least two positive numbers, for example "
            "np.geomspace(0.01, 10, 200)"
        )  # fmt: skip
    gain = _gain(nonlinearity)
    omega = response.omega[response.omega < given.top]
    found = _intersections(omega, response.at(omega), sizes, gain(sizes))
    cycles: list[PredictedCycle] = []
    for w, A in found:
        cycle = _refined(given, gain, w, A, (sizes[0], sizes[-1]))
        if cycle and not any(_same(cycle, each) for each in cycles):
            cycles.append(cycle)
    return PredictedCycles(
        response.name, tuple(sorted(cycles, key=lambda each: each.amplitude))
    )


Gain = Callable[[NDArray[np.float64]], NDArray[np.complex128]]


def _gain(nonlinearity: Any) -> Gain:
    import control

    def gain(sizes: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.atleast_1d(
            np.asarray(control.describing_function(nonlinearity, sizes), dtype=complex)
        )

    return gain


class _Loop(NamedTuple):
    response: LoopResponse
    top: float
    """Nyquist frequency of a sampled loop, rad/s; infinite for a continuous one."""
    stable_with: Callable[[float], bool]
    """Returns whether the loop is stable with a factor in place of the nonlinearity."""


def _measured(data: Any, delay_s: float, unstable_poles: int) -> _Loop:
    measured, _ = measured_response(data, unstable_poles, delay_s)
    L, period = measured.at(measured.omega), response_period(data)
    return _Loop(
        measured,
        math.pi / period if period else math.inf,
        lambda factor: nyquist_stable(measured.omega, factor * L, unstable_poles),
    )


def _modeled(model: LinearModel, delay_s: float) -> _Loop:
    if model.B.shape[1] != 1 or model.C.shape[0] != 1:
        raise InputError(
            "loop",
            f"has {model.B.shape[1]} inputs and {model.C.shape[0]} outputs; a "
            "describing function needs one of each",
        )
    if delay_s and not model.period_s:
        late, _ = delayed_response(model, delay_s)
        return _Loop(
            late,
            math.inf,
            lambda factor: stable_with_delay(_scaled(model, factor), delay_s),
        )
    if delay_s:
        model = delayed_model(model, delay_s)

    def at(w: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.asarray(model.response(w)[0, 0])

    omega = frequency_grid(model.poles, model.period_s)
    return _Loop(
        LoopResponse(model.name, omega, at),
        math.pi / model.period_s if model.period_s else math.inf,
        lambda factor: loop_margins(_scaled(model, factor)).stable,
    )


def _scaled(model: LinearModel, factor: float) -> LinearModel:
    return replace(model, C=factor * model.C, D=factor * model.D)


def _intersections(
    omega: NDArray[np.float64],
    L: NDArray[np.complex128],
    sizes: NDArray[np.float64],
    gains: NDArray[np.complex128],
) -> list[tuple[float, float]]:
    """Frequencies and amplitudes at which the curves L and -1/N cross."""
    usable = np.abs(gains) > 1e-12
    sizes, other = sizes[usable], -1.0 / gains[usable]
    p, r = L[:-1, None], np.diff(L)[:, None]
    q, s = other[None, :-1], np.diff(other)[None]
    # p + t r = q + u s, with the cross product of complex numbers as vectors.
    cross = (np.conj(r) * s).imag
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (np.conj(q - p) * s).imag / cross
        u = (np.conj(q - p) * r).imag / cross
    here = (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
    return [
        (
            float(omega[i] + t[i, j] * (omega[i + 1] - omega[i])),
            float(sizes[j] + u[i, j] * (sizes[j + 1] - sizes[j])),
        )
        for i, j in np.argwhere(here)
    ]


def _refined(
    given: _Loop, gain: Gain, w: float, A: float, sizes: tuple[float, float]
) -> PredictedCycle | None:
    """Solves 1 + N(A) L(jw) = 0 near a crossing; None if there is no solution."""

    def excess(log_w: float, log_A: float) -> complex:
        L = given.response.at(np.array([math.exp(log_w)]))[0]
        return complex(1.0 + gain(np.array([math.exp(log_A)]))[0] * L)

    def parts(x: NDArray[np.float64]) -> list[float]:
        value = excess(*x)
        return [value.real, value.imag]

    solved = root(parts, [math.log(w), math.log(A)], tol=1e-12)
    log_w, log_A = solved.x
    w, A = math.exp(log_w), math.exp(log_A)
    if (
        abs(excess(log_w, log_A)) > _SOLVED
        or not sizes[0] <= A <= sizes[1]
        or w >= given.top
    ):
        return None
    # A pole s of the loop moves by ds = -(dF/dA) / (dF/ds) dA, with F = 1 + N L.
    by_A = (excess(log_w, log_A + _STEP) - excess(log_w, log_A - _STEP)) / (2 * _STEP)
    by_w = (excess(log_w + _STEP, log_A) - excess(log_w - _STEP, log_A)) / (2 * _STEP)
    growth = (-by_A / (by_w / (1j * w))).real
    stable = growth < 0.0
    larger = complex(gain(np.array([A * (1.0 + _LARGER)]))[0])
    if stable and abs(larger.imag) < _SOLVED:
        # Another pair of poles may grow at the same time.
        stable = given.stable_with(larger.real)
    return PredictedCycle(A, w, stable)


def _same(one: PredictedCycle, other: PredictedCycle) -> bool:
    return (
        abs(one.amplitude / other.amplitude - 1.0) < _SAME
        and abs(one.frequency_rad_s / other.frequency_rad_s - 1.0) < _SAME
    )
