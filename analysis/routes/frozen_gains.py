"""Poles and margins of a robot on a route, and bounds of its stiffness and damping."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.contact_mode import contact_model
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import LoopMargins, loop_margins
from analysis.routes.route_loop import (
    AXES,
    RoutePoint,
    acceleration_loop,
    contact_gains,
    frozen_model,
    route_law,
    route_points,
)
from diagrams.scenario.scenario import Scenario
from systems.laws.trajectory.impedance_adaptation import (
    DAMPING_BOX_N_S_M,
    STIFFNESS_BOX_N_M,
)
from systems.laws.trajectory.sampled_bounds import (
    SampledMass,
    damping_bound,
    stiffness_bound,
)
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_conventional import (
    TrajectoryImpedanceParameters,
)

#: Desired damping ratio.
WELL_DAMPED = 0.7
#: Delays of the position for which bounds are computed, in control periods. The first
#: is that of the model. The second adds the delay of a processor.
LATE_TICKS = (0, 1)
# Chart over damping: number of points, least damping in N s/m, and largest damping as
# a share of its bound.
_CHART_POINTS, _LEAST_N_S_M, _MOST = 60, 0.5, 0.97
_HALVINGS = 50


@dataclass(frozen=True)
class FrozenPoint:
    """The linearized loop at one operating point, with constant gains."""

    at: RoutePoint
    """The operating point."""
    stiffness_n_m: float
    """Sum of all springs along the route, N/m."""
    damping_n_s_m: float
    """Sum of all dampers along the route, N s/m."""
    model: LinearModel
    """Closed loop from the target to the control point P."""
    margins: dict[str, LoopMargins]
    """Margins of the loop cut at the acceleration, along and across the route."""


def frozen_gains(scenario: Scenario) -> tuple[FrozenPoint, ...]:
    """Computes poles and margins at each operating point of ``route_points``.

    The function raises an InputError if the law is not for a route, or if the wheels
    can slip.
    """
    return tuple(_frozen(scenario, point) for point in route_points(scenario))


def _frozen(scenario: Scenario, point: RoutePoint) -> FrozenPoint:
    own = route_law(scenario)
    stiffness, damping = own.stiffness_n_m, own.damping_n_s_m
    if point.wall_m is not None:
        contact = contact_gains(own, point.wall_m)
        stiffness, damping = stiffness + contact[0], damping + contact[1]
    return FrozenPoint(
        at=point,
        stiffness_n_m=stiffness,
        damping_n_s_m=damping,
        model=frozen_model(scenario, point),
        margins={
            axis: loop_margins(acceleration_loop(scenario, point, axis))
            for axis in AXES
        },
    )


@dataclass(frozen=True)
class GainBounds:
    """Bounds of stiffness K and damping D, some for each delay of the position."""

    mass: SampledMass
    """Mass, motor lag and control period."""
    late_ticks: tuple[int, ...]
    """Delays of the position in control periods, one per column of the curves."""
    damping_n_s_m: NDArray[np.float64]
    """(n,) dampings of the curves, N s/m."""
    stable_n_m: NDArray[np.float64]
    """(n, delays) stiffness at which the loop becomes unstable, N/m."""
    damped_n_m: NDArray[np.float64]
    """(n, delays) stiffness up to which the damping ratio is 0.7 or more, N/m."""
    today: dict[str, tuple[float, float]]
    """(K, D) of the scenario, for the target alone and with a contact."""
    stable_today_n_m: tuple[float, ...]
    """Stiffness at which the loop with the scenario's damping becomes unstable, N/m."""
    damped_today_n_m: tuple[float, ...]
    """Stiffness up to which that loop has a damping ratio of at least 0.7, N/m."""
    closed_form_n_m: tuple[float, ...]
    """``stable_today_n_m`` as computed by ``stiffness_bound``, N/m."""
    most_damping_n_s_m: float
    """Largest stable sum of dampers, by bisection, N s/m."""
    closed_damping_n_s_m: float
    """Largest stable sum of dampers by the formula 2 M/T, N s/m."""
    contacts: float
    """Largest stable number of contacts with full damping; infinite without damping."""
    box: tuple[tuple[float, float], tuple[float, float]] | None
    """Ranges of K and of D to which the adaptation is limited; None without limits."""


def gain_bounds(scenario: Scenario) -> GainBounds:
    """Computes bounds of stiffness K and damping D by bisection.

    Stability follows from the eigenvalues of the blocks' state matrix over one control
    period. The function raises an InputError if the law is not for a route, or if the
    wheels can slip.
    """
    own = route_law(scenario)
    of = SampledMass(
        scenario.only.robot.mass_kg, scenario.only.plant.motor_lag_s, scenario.tick_s
    )
    most = _most_damping(scenario)
    dampings = np.geomspace(_LEAST_N_S_M, _MOST * most, _CHART_POINTS)
    both = [
        [_bounds(scenario, float(d), late) for late in LATE_TICKS] for d in dampings
    ]
    curves = np.array(both)
    today = np.array(
        [_bounds(scenario, own.damping_n_s_m, late) for late in LATE_TICKS]
    )
    stiffness, damping = contact_gains(own, 0.5 * own.security_zone_m)
    k, d = own.stiffness_n_m, own.damping_n_s_m
    return GainBounds(
        mass=of,
        late_ticks=LATE_TICKS,
        damping_n_s_m=dampings,
        stable_n_m=curves[..., 0],
        damped_n_m=curves[..., 1],
        today={"target": (k, d), "half way in": (k + stiffness, d + damping)},
        stable_today_n_m=tuple(today[:, 0].tolist()),
        damped_today_n_m=tuple(today[:, 1].tolist()),
        closed_form_n_m=tuple(
            stiffness_bound(d, of._replace(late_ticks=late)) for late in LATE_TICKS
        ),
        most_damping_n_s_m=most,
        closed_damping_n_s_m=damping_bound(of),
        contacts=_contacts(own, most),
        box=_box(own),
    )


def axis_damping_ratio(
    scenario: Scenario, stiffness: float, damping: float, late_ticks: int = 0
) -> float:
    """Computes the damping ratio of the least damped mode along one axis.

    The ratio is the least value of -Re s/|s| over all modes; 1 if no mode oscillates.
    ``stiffness`` is the sum of all springs, N/m, above 0. ``damping`` is the sum of all
    dampers, N s/m. The springs act on a position that is ``late_ticks`` old.
    """
    return contact_model(
        scenario, stiffness, damping_n_s_m=damping, latency_ticks=late_ticks
    ).damping_ratio


def damped_stiffness(scenario: Scenario, damping: float, late_ticks: int = 0) -> float:
    """Computes the largest stiffness with a damping ratio of at least 0.7, N/m.

    The sum of all dampers is ``damping``, N s/m. If no stiffness has this damping
    ratio, the result is 0.
    """
    return _last(
        lambda k: axis_damping_ratio(scenario, k, damping, late_ticks) >= WELL_DAMPED
    )


def _bounds(scenario: Scenario, damping: float, late: int) -> tuple[float, float]:
    """Stiffness at which one axis becomes unstable, and at which it oscillates, N/m."""

    def rests(stiffness: float) -> bool:
        return contact_model(
            scenario, stiffness, damping_n_s_m=damping, latency_ticks=late
        ).stable

    return _last(rests), damped_stiffness(scenario, damping, late)


def _last(holds: Callable[[float], bool], begin: float = 1e-3) -> float:
    """Upper end of the interval from 0 in which a condition holds; 0 if it is empty."""
    if not holds(begin):
        return 0.0
    low, high = begin, 2.0 * begin
    while holds(high) and high < 1e9:
        low, high = high, 2.0 * high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def _most_damping(scenario: Scenario) -> float:
    """Damping at which a damper without a spring becomes unstable, N s/m."""

    def rests(damping: float) -> bool:
        poles = contact_model(scenario, 0.0, damping_n_s_m=damping).poles
        # Without a spring, the position has a pole at z = 1.
        moving = np.delete(poles, np.abs(poles - 1.0).argmin())
        return bool(np.abs(moving).max() < 1.0)

    return _last(rests)


def _contacts(own: TrajectoryImpedanceParameters, most: float) -> float:
    if own.contact_damping_n_s_m == 0.0:
        return math.inf
    room = (most - own.damping_n_s_m) / own.contact_damping_n_s_m
    # At the bound itself, the loop is not asymptotically stable.
    return float(max(math.ceil(room - 1e-6) - 1, 0))


def _box(
    own: TrajectoryImpedanceParameters,
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    projected = isinstance(own, AdaptiveTrajectoryParameters) and own.projected
    return (STIFFNESS_BOX_N_M, DAMPING_BOX_N_S_M) if projected else None
