"""Families of loops of a robot on a route, for uncertain parameters.

At rest and before a wall, the two axes of the motion of the control point P are
independent. While the robot drives, the motion across the route is coupled with the
heading. The gains are constant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from analysis.loops.motion_families import (
    Box,
    BoxFamilies,
    ClosedLoop,
    Interval,
    MotionFamily,
    axis_family,
    interval_family,
    of_box,
    plus,
    times,
)
from analysis.loops.robustness import (
    LAG_REASON,
    WHEEL_RADIUS,
    PoleFunction,
    UncertainParameter,
    within_share,
)
from analysis.routes.frozen_gains import FrozenPoint
from analysis.routes.route_loop import contact_gains, route_law
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: Share of the contact damping that acts, from the edge of a zone to deep in it.
_DEEP = (0.001, 0.5, 0.9)


def route_uncertainty(scenario: Scenario) -> tuple[UncertainParameter, ...]:
    """Returns the uncertain parameters of a robot on a route."""
    own, set_by = route_law(scenario), "as set"
    shares = (
        ("robot.mass_kg", "M", "kg", scenario.only.robot.mass_kg, 0.1, set_by),
        ("impedance.stiffness_n_m", "K", "N/m", own.stiffness_n_m, 0.1, set_by),
        ("impedance.damping_n_s_m", "D", "N s/m", own.damping_n_s_m, 0.1, set_by),
        (
            "impedance.contact_stiffness_n_m", "K_e", "N/m",
            own.contact_stiffness_n_m, 0.1, set_by,
        ),
        (
            "impedance.contact_damping_n_s_m", "D_e", "N s/m",
            own.contact_damping_n_s_m, 0.1, set_by,
        ),
        (
            "plant.motor_lag_s", "lag", "s", scenario.only.plant.motor_lag_s, 0.4,
            LAG_REASON,
        ),
    )  # fmt: skip
    found = [within_share(*row) for row in shares if row[3] > 0.0]
    found.append(WHEEL_RADIUS)
    if own.damping_fades and own.contact_damping_n_s_m > 0.0:
        low, nominal, high = _DEEP
        depth = "where in the zone the robot is"
        found.append(
            UncertainParameter(
                "contact_share",
                "share of D_e",
                "1",
                nominal,
                low,
                high,
                depth,
                scaled=False,
            )
        )
    return tuple(found)


def lateral_loop(
    scenario: Scenario, mass: float, lag: float, damping: float, stiffness: float
) -> ClosedLoop:
    """Computes the loop of the motion across a straight route over one period.

    The robot drives at the speed V of the target. Its axle is at y across the route, P
    is at y + e theta, and the yaw rate w follows its command u with the lag::

        y' = V theta,  theta' = w,  lag w' = u - w
        v+ = v - T/M (K (y + e theta) + D v),  u = (v+ - V theta)/e

    Args:
        scenario: Scenario with the control period T, the speed V, and the distance e
            from the axle to P.
        mass: Virtual mass M, kg.
        lag: Motor lag, s.
        damping: Damping D, N s/m.
        stiffness: Stiffness K, N/m.

    Returns:
        The loop, with the feedback at the acceleration of the law. Its four states are
        y, theta, w, v.
    """
    period, speed = scenario.tick_s, scenario.router.route.speed_m_s
    ahead = scenario.only.robot.control_point_m
    whole = np.zeros((4, 4))
    whole[0, 1], whole[1, 2] = speed, 1.0
    whole[2, 2:] = -1.0 / lag, 1.0 / lag
    held = expm(whole * period)
    pull = period / mass
    v = np.array([-pull * stiffness, -pull * stiffness * ahead, 0.0, 1.0])
    v[3] -= pull * damping
    command = (v - np.array([0.0, speed, 0.0, 0.0])) / ahead
    A = np.outer(held[:, 3], command)
    A[:3, :3] += held[:3, :3]
    A[3] = v
    B = period * np.append(held[:3, 3] / ahead, 1.0)[:, None]
    C = np.array([[stiffness, stiffness * ahead, 0.0, damping]]) / mass
    return ClosedLoop(A, B, C)


def route_families(scenario: Scenario) -> BoxFamilies:
    """Returns a function from a box to the loops of a robot on a route.

    The loops are those at rest, on the route, and before a wall in both directions.
    Raises InputError if the object sensor has a latency.
    """
    own = route_law(scenario)
    touches = own.contact_stiffness_n_m > 0.0 or own.contact_damping_n_s_m > 0.0
    if touches and scenario.router.objects.latency_s > 0.0:
        raise InputError(
            "objects.latency_s",
            f"is {scenario.router.objects.latency_s:g} s, and the reduced loops have "
            "no latency; set objects.latency_s=0",
        )
    mass, lag = scenario.only.robot.mass_kg, scenario.only.plant.motor_lag_s

    def families(box: Box) -> Sequence[MotionFamily]:
        spring = of_box(box, "impedance.stiffness_n_m", own.stiffness_n_m)
        damper = of_box(box, "impedance.damping_n_s_m", own.damping_n_s_m)
        masses = of_box(box, "robot.mass_kg", mass)
        lags = of_box(box, "plant.motor_lag_s", lag)
        found = [
            axis_family(scenario, box, spring, damper),
            interval_family(
                partial(lateral_loop, scenario),
                [masses, lags, damper, spring],
                scenario.tick_s,
            ),
        ]
        if touches:
            pushed, damped = _contact(scenario, box)
            more = plus(damper, damped)
            found.append(axis_family(scenario, box, plus(spring, pushed), more))
            found.append(axis_family(scenario, box, spring, more))
        return found

    return families


def _contact(scenario: Scenario, box: Box) -> tuple[Interval, Interval]:
    """Intervals of the stiffness, N/m, and of the damping, N s/m, of a contact."""
    own = route_law(scenario)
    stiffness, damping = (
        of_box(box, f"impedance.{name}", getattr(own, name))
        for name in ("contact_stiffness_n_m", "contact_damping_n_s_m")
    )
    share = box.get("contact_share", (1.0, 1.0))
    return times(box["wheel_radius_share"], stiffness), times(share, damping)


def route_poles(scenario: Scenario) -> PoleFunction:
    """Returns a function for the z-plane poles of all loops of ``route_families``."""
    families = route_families(scenario)

    def poles(values: Mapping[str, float]) -> NDArray[np.complex128]:
        box = {name: (value, value) for name, value in values.items()}
        matrices = [each.matrix_of(np.empty(0)) for each in families(box)]
        return np.concatenate(
            [np.linalg.eigvals(matrix).astype(complex) for matrix in matrices]
        )

    return poles


def nominal_difference(scenario: Scenario, points: Sequence[FrozenPoint]) -> float:
    """Returns the largest difference from the growth rates of the linearized blocks.

    Args:
        scenario: Scenario with the nominal parameters.
        points: Linearized loops of all operating points.

    Returns:
        Difference of the growth rates at the nominal parameters, 1/s.
    """
    own, found = route_law(scenario), []
    box = {p.name: (p.nominal, p.nominal) for p in route_uncertainty(scenario)}
    for point in points:
        at = point.at
        if at.wall_m is not None:
            full = own.contact_damping_n_s_m
            share = contact_gains(own, at.wall_m)[1] / full if full else 1.0
            box["contact_share"] = (share, share)
        rest, lateral, *contact = route_families(scenario)(box)
        loops = contact if at.wall_m is not None else [rest]
        if at.speed_m_s:
            loops = [rest, lateral]
        growth = max(each.exact_growth(np.empty(0)) for each in loops)
        found.append(abs(growth - point.model.growth_per_s))
    return float(max(found))
