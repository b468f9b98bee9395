"""Poles and margins of a robot on a route, and bounds of its stiffness and damping."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.contact_mode import contact_model
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import loop_margins
from analysis.loops.margin_results import LoopMargins
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
#: Delays of the position that the springs use, in control periods. Bounds are computed
#: for each of them. In the simulation, the delay is 0. A real processor may add 1.
LATE_TICKS = (0, 1)
# Dampings of the curves: their number, the least damping, N s/m, and the largest
# damping as a share of its bound.
_CHART_POINTS, _LEAST_N_S_M, _MOST = 60, 0.5, 0.97
_HALVINGS = 50


@dataclass(frozen=True)
class FrozenPoint:
    """The linearized loop at one operating point, with constant gains."""

    at: RoutePoint
    """The operating point."""
    stiffness_n_m: float
    """Stiffness along the route: to the target, plus that of a contact if any, N/m."""
    damping_n_s_m: float
    """Damping along the route: to the target, plus that of a contact if any, N s/m."""
    model: LinearModel
    """Closed loop from the motion of the target to the position of the control point
    P."""
    margins: dict[str, LoopMargins]
    """Margins of the loop that is cut at the law's acceleration. The keys are the
    directions ``AXES``: along and across the route."""


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
    """Bounds of the stiffness and of the damping of a robot on a route.

    Stiffness is the sum of all springs, and damping is the sum of all dampers. Some
    bounds have one value for each delay of the position that the springs use.
    """

    mass: SampledMass
    """Mass, motor lag and control period."""
    late_ticks: tuple[int, ...]
    """Delays of the position, in control periods."""
    damping_n_s_m: NDArray[np.float64]
    """(n,) dampings for which ``stable_n_m`` and ``damped_n_m`` have rows, N s/m."""
    stable_n_m: NDArray[np.float64]
    """(n, delays) stiffness at which the loop becomes unstable, N/m."""
    damped_n_m: NDArray[np.float64]
    """(n, delays) stiffness up to which the damping ratio is 0.7 or more, N/m."""
    today: dict[str, tuple[float, float]]
    """(stiffness, damping) of the scenario, N/m and N s/m: with the target alone
    (``target``), and with a contact at half of its zone (``half way in``)."""
    stable_today_n_m: tuple[float, ...]
    """(delays,) stiffness at which the loop with the scenario's damping D becomes
    unstable, N/m."""
    damped_today_n_m: tuple[float, ...]
    """(delays,) stiffness up to which the loop with the scenario's damping D has a
    damping ratio of at least 0.7, N/m."""
    closed_form_n_m: tuple[float, ...]
    """(delays,) the bounds ``stable_today_n_m`` by the formula ``stiffness_bound``,
    N/m."""
    most_damping_n_s_m: float
    """Largest damping with which the loop without springs is stable, by bisection,
    N s/m."""
    closed_damping_n_s_m: float
    """The same damping by the formula 2 M/T, N s/m. M is the virtual mass, and T is the
    control period."""
    contacts: float
    """Largest number of contacts whose full dampings may act at once. Infinite if
    contacts have no damping."""
    box: tuple[tuple[float, float], tuple[float, float]] | None
    """Ranges of K and of D to which the adaptation is limited. None if the law does not
    limit its gains."""


def gain_bounds(scenario: Scenario) -> GainBounds:
    """Computes bounds of the stiffness and of the damping by bisection.

    The loop is stable if the eigenvalues of its state matrix over one control period
    are inside the unit circle. The matrix comes from the linearized blocks. The
    function raises an InputError if the law is not for a route, or if the wheels can
    slip.
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

    The result is the least value of -Re s/|s| over all poles s, or 1 if no mode
    oscillates. ``stiffness`` is the sum of all springs, N/m, and must be above 0.
    ``damping`` is the sum of all dampers, N s/m. The springs use a position that is
    ``late_ticks`` control periods old.
    """
    return contact_model(
        scenario, stiffness, damping_n_s_m=damping, latency_ticks=late_ticks
    ).damping_ratio


def damped_stiffness(scenario: Scenario, damping: float, late_ticks: int = 0) -> float:
    """Computes the stiffness up to which the damping ratio is at least 0.7, N/m.

    The arguments are those of ``axis_damping_ratio``. If even a very small stiffness
    has a lower damping ratio, the result is 0.
    """
    return _last(
        lambda k: axis_damping_ratio(scenario, k, damping, late_ticks) >= WELL_DAMPED
    )


def _bounds(scenario: Scenario, damping: float, late: int) -> tuple[float, float]:
    """Returns the two bounds of the stiffness for one damping and one delay, N/m.

    At the first, the loop becomes unstable. Up to the second, the damping ratio is at
    least 0.7.
    """

    def rests(stiffness: float) -> bool:
        return contact_model(
            scenario, stiffness, damping_n_s_m=damping, latency_ticks=late
        ).stable

    return _last(rests), damped_stiffness(scenario, damping, late)


def _last(holds: Callable[[float], bool], begin: float = 1e-3) -> float:
    """Returns the value up to which a condition holds, by bisection.

    The condition must hold at ``begin``; otherwise the result is 0.
    """
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
    """Returns the damping at which the loop without springs becomes unstable, N s/m."""

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
