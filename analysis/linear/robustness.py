"""What uncertain parameters do to the poles of a sampled loop.

The loop is given as a function from parameter values to poles in the z plane,
so that the same code serves every operating point. Nothing here knows what the
parameters mean.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

#: Poles in the z plane at given values of the parameters, by name; those that are
#: neutral whatever the values are (the heading at rest) are left out.
PoleFunction = Callable[[Mapping[str, float]], NDArray[np.complex128]]

#: Step of a difference quotient, as a share of the parameter's interval.
_STEP = 1e-3


@dataclass(frozen=True)
class UncertainParameter:
    """A number that is known within an interval."""

    name: str
    """Field of the scenario, or what else it is."""
    symbol: str
    unit: str
    nominal: float
    low: float
    """Least value; not above the nominal one."""
    high: float
    """Greatest value; not below the nominal one."""
    reason: str
    """Why the interval is as it is."""
    whole: bool = False
    """Whether it is a whole number."""

    def __post_init__(self) -> None:
        if not self.low <= self.nominal <= self.high or self.low == self.high:
            raise InputError(
                f"{self.name}",
                f"{self.nominal:g} is not within [{self.low:g}, {self.high:g}], or "
                "its ends are equal; correct the interval",
            )


@dataclass(frozen=True)
class PoleCloud:
    """Poles over the box of all uncertain parameters."""

    period_s: float
    """From which to which state the poles lead, s."""
    parameters: tuple[UncertainParameter, ...]
    nominal_poles: NDArray[np.complex128]
    """z plane."""
    values: NDArray[np.float64]
    """(samples, parameters)."""
    poles: tuple[NDArray[np.complex128], ...]
    """z plane, for each sample."""
    worst_values: dict[str, float]
    """Where the slowest decay, or the fastest growth, was found."""
    worst_poles: NDArray[np.complex128]

    @property
    def radii(self) -> NDArray[np.float64]:
        """(samples,) largest modulus of a pole."""
        return np.array([np.abs(poles).max() for poles in self.poles])

    @property
    def nominal_radius(self) -> float:
        """Largest modulus of a pole at the nominal values."""
        return float(np.abs(self.nominal_poles).max())

    @property
    def worst_radius(self) -> float:
        """Largest modulus of a pole that was found; below 1: robustly stable."""
        return float(np.abs(self.worst_poles).max())

    @property
    def stable_share(self) -> float:
        """Of the samples."""
        return float(np.mean(self.radii < 1.0))

    @property
    def worst_damping_ratio(self) -> float:
        """Of the slowest pole in the worst case."""
        return damping_ratio(slowest_pole(self.worst_poles), self.period_s)


@dataclass(frozen=True)
class PoleSensitivity:
    """How the slowest pole answers to one parameter."""

    parameter: UncertainParameter
    pole: complex
    """The pole at the nominal values, 1/s: ln(z)/T."""
    derivative: complex
    """d(pole)/d(parameter), in 1/s over the parameter's unit."""
    per_interval: complex
    """Change of the pole over the whole interval, to first order, 1/s."""


def slowest_pole(poles: NDArray[np.complex128]) -> complex:
    """The pole of largest modulus; of a pair the one in the upper half plane."""
    pole = complex(poles[np.argmax(np.abs(poles))])
    return pole if pole.imag >= 0.0 else pole.conjugate()


def continuous(pole: complex, period: float) -> complex:
    """A pole in the z plane as one in the s plane.

    Args:
        pole: z, not 0.
        period: T, s.

    Returns:
        ln(z)/T, 1/s.
    """
    return complex(np.log(pole) / period)


def damping_ratio(pole: complex, period: float) -> float:
    """Of a pole in the z plane; negative where it grows.

    Args:
        pole: z, neither 0 nor 1.
        period: Sampling period, s.

    Returns:
        -1 to 1.
    """
    s = continuous(pole, period)
    return -s.real / abs(s)


def pole_cloud(
    poles: PoleFunction,
    parameters: Sequence[UncertainParameter],
    *,
    period: float,
    samples: int,
    seed: int,
) -> PoleCloud:
    """Poles at random points of the box, and at the worst corner.

    The points are a Latin hypercube. The corner is found by changing one
    parameter after the other to the other end of its interval while that
    slows the decay, from the nominal point on: the worst corner wherever each
    parameter acts in one direction. The worst of it and of the points counts.

    Args:
        poles: The loop.
        parameters: The box.
        period: Sampling period, s.
        samples: Number of random points.
        seed: Of these.

    Returns:
        Poles in the z plane: nominal, of every point, and the worst.
    """
    from scipy.stats import qmc

    low = np.array([p.low for p in parameters])
    high = np.array([p.high for p in parameters])
    unit = qmc.LatinHypercube(len(parameters), rng=np.random.default_rng(seed))
    values = low + unit.random(samples) * (high - low)
    whole = np.array([p.whole for p in parameters])
    values = np.where(whole, np.round(values), values)
    found = [poles(_named(parameters, row)) for row in values]
    candidates = [*zip(values, found, strict=True), _worst_corner(poles, parameters)]
    worst, worst_poles = max(candidates, key=lambda item: _radius(item[1]))
    return PoleCloud(
        period,
        tuple(parameters),
        poles({p.name: p.nominal for p in parameters}),
        values,
        tuple(found),
        _named(parameters, worst),
        worst_poles,
    )


def _named(
    parameters: Sequence[UncertainParameter], row: NDArray[np.float64]
) -> dict[str, float]:
    return {p.name: float(value) for p, value in zip(parameters, row, strict=True)}


def _radius(poles: NDArray[np.complex128]) -> float:
    return float(np.abs(poles).max())


def _worst_corner(
    poles: PoleFunction, parameters: Sequence[UncertainParameter]
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    best = np.array([p.nominal for p in parameters])
    best_poles = poles(_named(parameters, best))
    improved = True
    while improved:
        improved = False
        for k, parameter in enumerate(parameters):
            for end in {parameter.low, parameter.high} - {best[k]}:
                trial = best.copy()
                trial[k] = end
                trial_poles = poles(_named(parameters, trial))
                if _radius(trial_poles) > _radius(best_poles) + 1e-12:
                    best, best_poles, improved = trial, trial_poles, True
    return best, best_poles


def pole_sensitivities(
    poles: PoleFunction, parameters: Sequence[UncertainParameter], *, period: float
) -> tuple[PoleSensitivity, ...]:
    """Derivatives of the slowest pole, by central differences.

    At an end of its interval a parameter is varied to the inside only, and a
    whole number over its whole interval. The pole is followed as the nearest
    one, which holds for simple poles.

    Args:
        poles: The loop.
        parameters: The box.
        period: Sampling period, s.

    Returns:
        One a parameter, in their order; poles in 1/s.
    """
    nominal = {p.name: p.nominal for p in parameters}
    pole = slowest_pole(poles(nominal))
    rows = []
    for p in parameters:
        step = (1.0 if p.whole else _STEP) * (p.high - p.low)
        ends = (max(p.nominal - step, p.low), min(p.nominal + step, p.high))
        moved = [
            continuous(_nearest(poles({**nominal, p.name: end}), pole), period)
            for end in ends
        ]
        derivative = (moved[1] - moved[0]) / (ends[1] - ends[0])
        rows.append(
            PoleSensitivity(
                p, continuous(pole, period), derivative, derivative * (p.high - p.low)
            )
        )
    return tuple(rows)


def _nearest(poles: NDArray[np.complex128], pole: complex) -> complex:
    return complex(poles[np.argmin(np.abs(poles - pole))])
