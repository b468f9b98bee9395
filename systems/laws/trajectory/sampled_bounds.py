"""Stability bounds of stiffness, damping, and adaptation rate of a sampled robot."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)

#: Bounds of the number gamma (a T/M)^2, by rule of the adaptation. gamma is the rate
#: of the adaptation, and a is the amplitude of P's target, m. T is the control
#: period, s, and M is the virtual mass, kg. Below the bound, K and D do not run away.
#: The values are rounded down from the results of ``critical_rate`` in
#: ``analysis.routes.adaptation_stability``. These results are for periods of 25 to
#: 100 ms and a reference with the nominal gains. Other references have lower bounds.
RATE_BOUNDS = {"lyapunov": 1.0, "sensitivity": 0.5}
#: Largest stiffness in the search for the bound, N/m.
_STIFFEST_N_M = 1e7
#: Number of bisections in the search for the bound.
_HALVINGS = 60


class SampledMass(NamedTuple):
    """Virtual mass and motors, which turn the force of the law into motion of P."""

    mass_kg: float
    """Virtual mass M, kg."""
    motor_lag_s: float
    """Time constant of the first-order lag of each wheel, s."""
    tick_s: float
    late_ticks: int = 0
    """Age of the position that the springs use, ticks."""


def sampled_matrix(
    stiffness: float, damping: float, of: SampledMass
) -> NDArray[np.float64]:
    """Computes the matrix A that advances one axis of the robot by one control period.

    The virtual mass M has a spring of stiffness K to a fixed point, and a damper D. The
    velocity v of the virtual mass is the command of the wheels. The wheel speed w
    follows v with the time constant lag. The control point P is at p and moves at the
    speed w. T is the control period::

        v+ = v - T/M (K p + D v),  w+ = a w + (1 - a) v+,  a = exp(-T/lag)
        p+ = p + lag (1 - a) w + (T - lag (1 - a)) v+

    If ``late_ticks`` is above 0, the spring uses the position p of ``late_ticks``
    periods ago. The damper acts without delay.

    Args:
        stiffness: Sum of the stiffnesses of all springs, N/m.
        damping: Sum of all dampers, N s/m.
        of: Mass, lag, control period, and ``late_ticks``.

    Returns:
        (3 + late_ticks, 3 + late_ticks) matrix A of x+ = A x. The state x contains p,
        w, v, then the earlier values of p.
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
    """Computes by bisection the stiffness above which one axis is unstable.

    The function caches its results, because the runs of a sweep use the same arguments.

    Args:
        damping: Sum of all dampers, N s/m.
        of: Mass, lag, and control period.

    Returns:
        Stiffness, N/m; 0 if every stiffness is unstable with this damping.
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
    """Computes the largest stable damping 2 M/T, N s/m.

    M is the virtual mass, and T is the control period. With more damping, the velocity
    changes sign in every control period and grows.
    """
    return 2.0 * of.mass_kg / of.tick_s


def pull_through_m(own: TrajectoryImpedanceParameters) -> float:
    """Computes the lead at which the target pulls P through a contact.

    P is the control point of the robot. The lead is K_e S/K, m. K is the stiffness to
    the target, K_e is the stiffness of contacts, and S is the distance at which
    contacts begin. If K_e is 0, the result is 1 m.
    """
    lag = own.contact_stiffness_n_m * own.security_zone_m / own.stiffness_n_m
    return lag or 1.0


def rate_bound(rule: str, amplitude_m: float, of: SampledMass) -> float:
    """Computes the adaptation rate gamma above which the gains K and D may run away.

    K is the stiffness to the target, and D is the damping. The bound assumes that the
    gains have no limits.

    Args:
        rule: ``lyapunov`` or ``sensitivity``.
        amplitude_m: Amplitude of the target's motion, or distance by which the target
            leads the control point P, m.
        of: Mass and control period.

    Returns:
        Rate, (N/m)^2/(m^2 s), proportional to 1/amplitude_m^2.
    """
    return RATE_BOUNDS[rule] * (of.mass_kg / (amplitude_m * of.tick_s)) ** 2
