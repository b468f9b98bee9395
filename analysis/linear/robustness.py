"""Effects of uncertain parameters on the poles of a sampled loop.

A function from parameter values to poles in the z plane represents the loop. The same
code therefore serves every operating point, and does not depend on the meaning of the
parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.models.linear_models import damping_ratio, growth_per_s, s_plane
from systems.framework.input_error import InputError

#: Function from parameter values by name to poles in the z plane. Poles that are
#: neutral at all values (the heading at rest) are left out.
PoleFunction = Callable[[Mapping[str, float]], NDArray[np.complex128]]

#: Step of the finite differences, as a share of the parameter's interval.
_STEP = 1e-3


@dataclass(frozen=True)
class UncertainParameter:
    """Parameter that is known only to lie in an interval."""

    name: str
    """Field of the scenario, or another name that the pole function knows."""
    symbol: str
    unit: str
    nominal: float
    low: float
    high: float
    reason: str
    """Reason for the width of the interval."""
    whole: bool = False
    """Whether only whole numbers are possible."""

    def __post_init__(self) -> None:
        if not self.low <= self.nominal <= self.high or self.low == self.high:
            raise InputError(
                f"{self.name}",
                f"{self.nominal:g} is not within [{self.low:g}, {self.high:g}], or "
                "its ends are equal; correct the interval",
            )


@dataclass(frozen=True)
class PoleCloud:
    """Poles over all combinations of uncertain parameters."""

    period_s: float
    parameters: tuple[UncertainParameter, ...]
    nominal_poles: NDArray[np.complex128]
    """Poles at the nominal values, in the z plane."""
    values: NDArray[np.float64]
    """(samples, parameters) random values."""
    poles: tuple[NDArray[np.complex128], ...]
    """Poles of each sample, in the z plane."""
    worst_values: dict[str, float]
    """Values with the slowest decay, or the fastest growth, that was found."""
    worst_poles: NDArray[np.complex128]

    @property
    def radii(self) -> NDArray[np.float64]:
        """(samples,) largest |z| of each sample."""
        return np.array([np.abs(poles).max() for poles in self.poles])

    @property
    def nominal_radius(self) -> float:
        """Largest |z| at the nominal values."""
        return float(np.abs(self.nominal_poles).max())

    @property
    def worst_radius(self) -> float:
        """Largest |z| that was found. If it is below 1, no unstable case was found."""
        return float(np.abs(self.worst_poles).max())

    @property
    def stable_share(self) -> float:
        """Share of stable samples, 0 to 1."""
        return float(np.mean(self.radii < 1.0))

    @property
    def worst_damping_ratio(self) -> float:
        """Damping ratio of the slowest pole in the worst case."""
        return float(damping_ratio(slowest_pole(self.worst_poles, self.period_s)))

    @property
    def nominal_damping_ratio(self) -> float:
        """Damping ratio of the slowest pole at the nominal values."""
        return float(damping_ratio(slowest_pole(self.nominal_poles, self.period_s)))

    @property
    def worst_growth_per_s(self) -> float:
        """Growth rate in the worst case, 1/s; negative if it decays."""
        return float(growth_per_s(self.worst_radius, self.period_s))


@dataclass(frozen=True)
class PoleSensitivity:
    """Sensitivity of the slowest pole to one parameter."""

    parameter: UncertainParameter
    pole: complex
    """Slowest pole ln(z)/T at the nominal values, 1/s."""
    derivative: complex
    """d(pole)/d(parameter), in 1/s per unit of the parameter."""
    per_interval: complex
    """First-order change of the pole over the whole interval, 1/s."""


def slowest_pole(poles: NDArray[np.complex128], period: float) -> complex:
    """Returns the pole z with the largest |z| in the s plane, 1/s.

    Of a conjugate pair, the pole in the upper half plane is returned.
    """
    pole = complex(s_plane(poles[[np.argmax(np.abs(poles))]], period)[0])
    return pole if pole.imag >= 0.0 else pole.conjugate()


def pole_cloud(
    poles: PoleFunction,
    parameters: Sequence[UncertainParameter],
    *,
    period: float,
    samples: int,
    seed: int,
) -> PoleCloud:
    """Computes the poles at random parameter values and searches for the worst values.

    The random values are a Latin hypercube. The search for the worst corner begins at
    the nominal values. It moves one parameter after the other to the other end of its
    interval, as long as this slows the decay. It finds the worst corner if each
    parameter acts in one direction only. The worst case is the worse of this corner and
    the worst sample. ``period`` is in s.
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
    """Computes the derivatives of the slowest pole by finite differences.

    The differences are central, with two exceptions. If the nominal value is an end of
    the interval, the parameter varies towards the inside only. A whole number varies
    over its whole interval. After the variation, the pole nearest to the nominal pole
    counts as the same pole. This is valid for simple poles. ``period`` is in s.
    """
    nominal = {p.name: p.nominal for p in parameters}
    pole = slowest_pole(poles(nominal), period)
    rows = []
    for p in parameters:
        step = (1.0 if p.whole else _STEP) * (p.high - p.low)
        ends = (max(p.nominal - step, p.low), min(p.nominal + step, p.high))
        moved = [
            _nearest(s_plane(poles({**nominal, p.name: end}), period), pole)
            for end in ends
        ]
        derivative = (moved[1] - moved[0]) / (ends[1] - ends[0])
        change = derivative * (p.high - p.low)
        rows.append(PoleSensitivity(p, pole, derivative, change))
    return tuple(rows)


def _nearest(poles: NDArray[np.complex128], pole: complex) -> complex:
    return complex(poles[np.argmin(np.abs(poles - pole))])
