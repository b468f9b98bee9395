"""How stiff, damped and quick to adapt a sampled robot on a route may be."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.laws.trajectory.parameters import TrajectoryImpedanceParameters

#: gamma (a T/M)^2 of each rule below which K and D do not run away, with a the
#: amplitude of P's target, m: rounded down from what ``critical_rate`` of
#: ``analysis.trajectory.adaptation_stability`` measures for ticks of 25 to 100 ms and a
#: reference with the nominal gains; another reference has less.
RATE_BOUNDS = {"lyapunov": 1.0, "sensitivity": 0.5}
#: Stiffer springs are not looked for, N/m.
_STIFFEST_N_M = 1e7
#: Halvings of an interval of stiffness.
_HALVINGS = 60


class SampledMass(NamedTuple):
    """The virtual mass and the motors, on the way from the law to the place of P."""

    mass_kg: float
    """M."""
    motor_lag_s: float
    """Of each wheel, first order."""
    tick_s: float
    late_ticks: int = 0
    """Age of the place that springs act on."""


def sampled_matrix(
    stiffness: float, damping: float, of: SampledMass
) -> NDArray[np.float64]:
    """x+ = A x of one axis: what a spring to rest and a damper make of a tick.

    The velocity v of the virtual mass, damped as it is, commands the wheels, whose
    speed w moves P::

        v+ = v - T/M (K p + D v),  w+ = a w + (1 - a) v+,  a = exp(-T/lag)
        p+ = p + lag (1 - a) w + (T - lag (1 - a)) v+

    Args:
        stiffness: All springs together, N/m.
        damping: All dampers together, N s/m.
        of: Mass, lag and tick.

    Returns:
        (3 + late_ticks, 3 + late_ticks); states p, w, v, then earlier p.
    """
    size, tick_s = 3 + of.late_ticks, of.tick_s
    kept = math.exp(-tick_s / of.motor_lag_s)
    coasting = of.motor_lag_s * (1.0 - kept)
    v = np.zeros(size)
    v[2] = 1.0 - tick_s * damping / of.mass_kg
    v[size - 1 if of.late_ticks else 0] -= tick_s * stiffness / of.mass_kg
    matrix = np.zeros((size, size))
    matrix[0] = (tick_s - coasting) * v
    matrix[0, :2] += 1.0, coasting
    matrix[1] = (1.0 - kept) * v
    matrix[1, 1] += kept
    matrix[2] = v
    if of.late_ticks:
        matrix[3, 0] = 1.0
        matrix[4:, 3:-1] = np.eye(of.late_ticks - 1)
    return matrix


@lru_cache(maxsize=64)
def stiffness_bound(damping: float, of: SampledMass) -> float:
    """The stiffness at which an axis stops coming to rest, by bisection.

    The runs of a sweep ask for the same ones.

    Args:
        damping: All dampers together, N s/m.
        of: Mass, lag and tick.

    Returns:
        N/m; 0 where no spring comes to rest with this damping.
    """

    def rests(stiffness: float) -> bool:
        matrix = sampled_matrix(stiffness, damping, of)
        return bool(np.abs(np.linalg.eigvals(matrix)).max() < 1.0)

    if not 0.0 < damping < damping_bound(of):
        return 0.0
    low, high = 0.0, 1.0
    while rests(high) and high < _STIFFEST_N_M:
        low, high = high, 2.0 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(middle) else (low, middle)
    return low


def damping_bound(of: SampledMass) -> float:
    """2 M/T: with more, the velocity changes sign at every tick and grows, N s/m."""
    return 2.0 * of.mass_kg / of.tick_s


def pull_through_m(own: TrajectoryImpedanceParameters) -> float:
    """Lag K_e S/K at which the target pulls P through a contact; 1 m without one.

    Args:
        own: The law's parameters.

    Returns:
        m.
    """
    lag = own.contact_stiffness_n_m * own.security_zone_m / own.stiffness_n_m
    return lag or 1.0


def rate_bound(rule: str, amplitude_m: float, of: SampledMass) -> float:
    """gamma from which K and D may run away where nothing bounds or normalises them.

    Args:
        rule: ``lyapunov`` or ``sensitivity``.
        amplitude_m: a: how far the target swings, or is ahead of P, m.
        of: Mass and tick.

    Returns:
        (N/m)^2/(m^2 s); it falls with a^2.
    """
    return RATE_BOUNDS[rule] * (of.mass_kg / (amplitude_m * of.tick_s)) ** 2
