"""Families of loops of a robot's motion, with few uncertain parameters.

Near a point of rest, the motion of the control point P along each principal direction
of the stiffness is that of one axis: a virtual mass M with a spring and a damper, and
the lag of the motors (``sampled_matrix``). The uncertain parameters of the report reach
the poles only through M, the damping, the lag, and the product of wheel radius and
stiffness. If these four are independent, so are their intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.loops.equilibria import nearest_equilibrium
from analysis.loops.force_field import ForceField
from analysis.loops.growth_bound import Family
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_family import LoopFamily
from analysis.loops.operating_points import FLAT, OperatingPoint
from analysis.loops.parameter_polynomial import ParameterPolynomial, fit_polynomial
from analysis.loops.robustness import range_slope
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.sampled_bounds import SampledMass, sampled_matrix

#: Number of values at which the range of a smooth function is read.
_STEPS = 401

Vector = NDArray[np.float64]
Interval = tuple[float, float]
#: Intervals of the uncertain parameters, by name.
Box = Mapping[str, Interval]


class ClosedLoop(NamedTuple):
    """Sampled loop with feedback u = -C x, where u acts through B."""

    A: NDArray[np.float64]
    """(n, n) matrix of the closed loop."""
    B: NDArray[np.float64]
    """(n, 1) effect of u over one period."""
    C: NDArray[np.float64]
    """(1, n) feedback."""


class MotionFamily(Family):
    """Loops whose motion and margins depend on parameters in a box."""

    def __init__(
        self,
        loop_of: Callable[[Vector], ClosedLoop],
        period_s: float,
        low: Vector,
        high: Vector,
    ) -> None:
        """Stores the loops; the arguments are those of ``Family``."""
        super().__init__(lambda values: loop_of(values).A, period_s, low, high)
        self._loop_of = loop_of

    @cached_property
    def opened(self) -> LoopFamily:
        """The loops, opened at the feedback."""

        def model_of(values: Vector) -> LinearModel:
            loop = self._loop_of(values)
            names = tuple(f"x{k}" for k in range(len(loop.A)))
            A, D = loop.A + loop.B @ loop.C, np.zeros((1, 1))
            return LinearModel(
                "loop", A, loop.B, loop.C, D, names, ("u",), ("y",), self.period_s
            )

        return LoopFamily(model_of, self.low, self.high)


#: Function from a box to the loops in it. Each family is one direction of motion.
BoxFamilies = Callable[[Box], Sequence[MotionFamily]]


def interval_family(
    loop_of: Callable[..., ClosedLoop],
    intervals: Sequence[Interval],
    period_s: float,
) -> MotionFamily:
    """Returns the loops whose arguments are known to lie in intervals.

    Args:
        loop_of: Function from one number per interval to the loop.
        intervals: Interval of each argument. An interval with equal ends is a constant.
        period_s: Sample period, s.

    Returns:
        The loops. Their parameters are the arguments that vary.
    """
    low, high = np.array(intervals).T
    vary = high > low

    def of_varying(values: Vector) -> ClosedLoop:
        row = low.copy()
        row[vary] = values
        return loop_of(*row.tolist())

    return MotionFamily(of_varying, period_s, low[vary], high[vary])


def axis_family(
    scenario: Scenario,
    box: Box,
    stiffness_n_m: Interval | None,
    damping_n_s_m: Interval,
    late_ticks: int = 0,
) -> MotionFamily:
    """Returns the loops of the motion of P along one axis.

    The loops are opened at the acceleration that the springs and dampers command.

    Args:
        scenario: Scenario with the mass, the motor lag, and the control period.
        box: Intervals of mass and motor lag; each may be missing.
        stiffness_n_m: Interval of the stiffness times the wheel radius share, N/m. None
            means that there is no spring; the neutral pole at z = 1 is then left out.
        damping_n_s_m: Interval of the damping, N s/m.
        late_ticks: Age of the position that the spring uses, ticks.

    Returns:
        The loops.
    """
    period = scenario.tick_s

    def loop_of(
        mass: float, lag: float, damping: float, stiffness: float
    ) -> ClosedLoop:
        of = SampledMass(mass, lag, period, late_ticks)
        A = sampled_matrix(stiffness, damping, of)
        # A damper of M commands -v, the third state, as its acceleration.
        B = (sampled_matrix(0.0, 0.0, of) - sampled_matrix(0.0, mass, of))[:, 2:3]
        C = np.zeros((1, len(A)))
        C[0, 2], C[0, -1 if late_ticks else 0] = damping / mass, stiffness / mass
        first = 0 if stiffness_n_m else 1
        return ClosedLoop(A[first:, first:], B[first:], C[:, first:])

    intervals = [
        of_box(box, "robot.mass_kg", scenario.only.robot.mass_kg),
        of_box(box, "plant.motor_lag_s", scenario.only.plant.motor_lag_s),
        damping_n_s_m,
        stiffness_n_m or (0.0, 0.0),
    ]
    return interval_family(loop_of, intervals, period)


def of_box(box: Box, name: str, nominal: float) -> Interval:
    """Returns the interval of a parameter, or its nominal value if it is certain."""
    return box.get(name, (nominal, nominal))


def times(one: Interval, other: Interval) -> Interval:
    """Returns the interval of the product of two positive parameters."""
    return (one[0] * other[0], one[1] * other[1])


def plus(one: Interval, other: Interval) -> Interval:
    """Returns the interval of the sum of two independent parameters."""
    return (one[0] + other[0], one[1] + other[1])


def late_ticks(box: Box) -> range:
    """Returns the ages of the position that are possible, in ticks."""
    first, last = box.get("extra_ticks", (0.0, 0.0))
    return range(round(first), round(last) + 1)


def contact_families(scenario: Scenario) -> BoxFamilies:
    """Returns a function from a box to the loops of the motion toward an obstacle."""
    own = scenario.follower.attraction

    def families(box: Box) -> Sequence[MotionFamily]:
        spring = of_box(box, "attraction.stiffness_n_m", own.stiffness_n_m)
        stiffness = times(
            box["wheel_radius_share"], plus(spring, box["law_stiffness_n_m"])
        )
        damping = of_box(box, "attraction.damping_n_s_m", own.damping_n_s_m)
        return [
            axis_family(scenario, box, stiffness, damping, ticks)
            for ticks in late_ticks(box)
        ]

    return families


def following_families(at: OperatingPoint) -> BoxFamilies:
    """Returns a function from a box to the loops of the motion about an equilibrium.

    There is one family for each principal direction of the stiffness. The equilibrium
    moves with the stiffness of the attraction.
    """
    scenario = at.loop.scenario
    own = scenario.follower.attraction
    directions = _PrincipalStiffness(at)

    def families(box: Box) -> Sequence[MotionFamily]:
        springs = of_box(box, "attraction.stiffness_n_m", own.stiffness_n_m)
        speeds = of_box(box, "sound_speed_m_s", scenario.sound_speed_m_s)
        slopes = sorted(range_slope(scenario, speed) for speed in speeds)
        nominal = own.stiffness_n_m or 1.0  # without a spring, the shares are all 0
        shares = times(springs, (slopes[0] / nominal, slopes[1] / nominal))
        damping = of_box(box, "attraction.damping_n_s_m", own.damping_n_s_m)
        radius = box["wheel_radius_share"]
        return [
            axis_family(scenario, box, each and times(radius, each), damping)
            for each in directions.between(shares)
        ]

    return families


class _PrincipalStiffness:
    """Eigenvalues of the stiffness as functions of the attraction's stiffness."""

    def __init__(self, at: OperatingPoint) -> None:
        self._at, self._field = at, ForceField(at.loop)
        self._fitted: ParameterPolynomial | None = None

    def _matrix(self, share: Vector) -> Vector:
        """(4,) elements of the stiffness with ``share`` times the attraction, N/m."""
        scaled = self._field.with_attraction(float(share[0]))
        place = nearest_equilibrium(scaled, self._at.p_WP)
        if place is None:
            raise InputError(
                "attraction.stiffness_n_m",
                f"at {share[0]:g} times its value the equilibrium is gone; narrow the "
                "box",
            )
        return np.asarray(-scaled.gradient(place)[1].ravel())

    def between(self, shares: Interval) -> list[Interval | None]:
        """Intervals of the two eigenvalues, N/m; None for one that is always 0.

        ``shares`` are the ends of the attraction's stiffness, over its nominal value.
        """
        fitted = self._fitted
        if fitted is None or not (
            fitted.axes[0].low <= shares[0] <= shares[1] <= fitted.axes[0].high
        ):
            wide = (shares[0] * (1.0 - 1e-9), shares[1] * (1.0 + 1e-9))
            fitted = fit_polynomial(self._matrix, *np.array(wide)[:, None])
            self._fitted = fitted
        low, high = (fitted.axes[0].share(share) for share in shares)
        steps = _STEPS if shares[1] > shares[0] else 1
        values = np.linalg.eigvals(
            np.array(
                [
                    fitted.values(np.array([u])).reshape(2, 2)
                    for u in np.linspace(low, high, steps)
                ]
            )
        )
        size = float(np.abs(values).max())
        if np.abs(values.imag).max() > FLAT * size:
            raise InputError(
                "law",
                "turns the force sideways, so that the motion has no two principal "
                "directions",
            )
        found: list[Interval | None] = []
        for column in np.sort(values.real, axis=1).T:
            if np.abs(column).max() < FLAT * max(size, 1.0):
                found.append(None)
                continue
            # Between two of the values, and for the error of the fit.
            more = float(np.abs(np.diff(column)).max(initial=0.0))
            more += 2.0 * float(fitted.error.max())
            found.append((float(column.min()) - more, float(column.max()) + more))
        return found
