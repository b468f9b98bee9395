"""Families of loops of a robot's motion, with few uncertain parameters.

Near a point of rest, the motion of the control point P along each principal direction
of the stiffness is that of one axis: a virtual mass M with a spring and a damper, and
the lag of the motors (``sampled_matrix``). The uncertain parameters of the report reach
the poles only through M, the damping, the lag, and the product of wheel radius and
stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.equilibria import nearest_equilibrium
from analysis.loops.force_field import ForceField
from analysis.loops.growth_bound import Family
from analysis.loops.operating_points import FLAT, OperatingPoint
from analysis.loops.parameter_polynomial import fit_polynomial
from analysis.loops.robustness import range_slope
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.sampled_bounds import SampledMass, sampled_matrix

#: Fields of a ``SampledMass`` and of its damper, by name of the uncertain parameter.
_DIRECT = ("robot.mass_kg", "attraction.damping_n_s_m", "plant.motor_lag_s")
#: Number of values at which the range of a smooth function is read.
_STEPS = 401

Vector = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class AxisFamily:
    """Loops along one axis, for a box of uncertain parameters."""

    family: Family
    late_ticks: int


def axis_family(
    scenario: Scenario,
    box: dict[str, Interval],
    stiffness_n_m: Interval | None,
    late_ticks: int = 0,
) -> Family:
    """Returns the loops of the motion of P along one axis.

    Args:
        scenario: Scenario with the nominal parameters.
        box: Intervals of the uncertain parameters by name. Mass, damping, and motor lag
            are used; each may be missing.
        stiffness_n_m: Interval of the stiffness times the wheel radius share, N/m. None
            means that there is no spring; the neutral pole at z = 1 is then left out.
        late_ticks: Age of the position that the spring uses, ticks.

    Returns:
        The loops, with the parameters mass, damping, lag and stiffness, as far as they
        vary.
    """
    nominal = (
        scenario.only.robot.mass_kg,
        scenario.follower.attraction.damping_n_s_m,
        scenario.only.plant.motor_lag_s,
    )
    ends = [box.get(name, (v, v)) for name, v in zip(_DIRECT, nominal, strict=True)]
    ends.append(stiffness_n_m or (0.0, 0.0))
    whole = np.array(ends)
    vary = whole[:, 1] > whole[:, 0]
    period = scenario.tick_s

    def matrix_of(values: Vector) -> NDArray[np.float64]:
        row = whole[:, 0].copy()
        row[vary] = values
        mass, damping, lag, stiffness = row.tolist()
        of = SampledMass(mass, lag, period, late_ticks)
        matrix = sampled_matrix(stiffness, damping, of)
        return matrix if stiffness_n_m else matrix[1:, 1:]

    return Family(matrix_of, period, whole[vary, 0], whole[vary, 1])


FamiliesOf = Callable[[dict[str, Interval]], Sequence[Family]]


def contact_families(scenario: Scenario) -> FamiliesOf:
    """Returns a function from a box to the loops of the motion towards an obstacle."""
    nominal = scenario.follower.attraction.stiffness_n_m

    def families(box: dict[str, Interval]) -> Sequence[Family]:
        own = box.get("attraction.stiffness_n_m", (nominal, nominal))
        law, radius = box["law_stiffness_n_m"], box["wheel_radius_share"]
        stiffness = _product(radius, (own[0] + law[0], own[1] + law[1]))
        first, last = map(round, box.get("extra_ticks", (0.0, 0.0)))
        return [
            axis_family(scenario, box, stiffness, ticks)
            for ticks in range(first, last + 1)
        ]

    return families


def following_families(at: OperatingPoint) -> FamiliesOf:
    """Returns a function from a box to the loops of the motion about an equilibrium.

    There is one family for each principal direction of the stiffness. The equilibrium
    moves with the stiffness of the attraction.
    """
    scenario = at.loop.scenario
    field = ForceField(at.loop)
    nominal = scenario.follower.attraction.stiffness_n_m

    def stiffness(share: Vector) -> Vector:
        scaled = field.with_attraction(float(share[0]))
        place = nearest_equilibrium(scaled, at.p_WP)
        if place is None:
            raise InputError(
                "attraction.stiffness_n_m",
                f"at {share[0]:g} times its value the equilibrium is gone; narrow the "
                "box",
            )
        return np.asarray(-scaled.gradient(place)[1].ravel())

    def families(box: dict[str, Interval]) -> Sequence[Family]:
        own = box.get("attraction.stiffness_n_m", (nominal, nominal))
        speeds = box.get("sound_speed_m_s", (scenario.sound_speed_m_s,) * 2)
        slopes = sorted(range_slope(scenario, speed) for speed in speeds)
        shares = own[0] * slopes[0] / nominal, own[1] * slopes[1] / nominal
        radius = box["wheel_radius_share"]
        return [
            axis_family(scenario, box, each and _product(radius, each))
            for each in _principal(stiffness, shares)
        ]

    return families


def _product(one: Interval, other: Interval) -> Interval:
    return (one[0] * other[0], one[1] * other[1])


def _principal(
    stiffness: Callable[[Vector], Vector], shares: Interval
) -> list[Interval | None]:
    """Intervals of the two eigenvalues of the stiffness; None if one is always 0."""
    fitted = fit_polynomial(stiffness, *np.array(shares)[:, None])
    places = np.linspace(0.0, 1.0, _STEPS)
    matrices = np.array([fitted.values(np.array([u])) for u in places])
    values = np.linalg.eigvals(matrices.reshape(-1, 2, 2))
    size = np.abs(values).max()
    if np.abs(values.imag).max() > FLAT * size:
        raise InputError(
            "law", "turns the force, so that no principal directions exist"
        )
    found: list[Interval | None] = []
    for column in np.sort(values.real, axis=1).T:
        if np.abs(column).max() < FLAT * max(size, 1.0):
            found.append(None)
            continue
        more = float(np.abs(np.diff(column)).max() + 2.0 * fitted.error.max())
        found.append((float(column.min()) - more, float(column.max()) + more))
    return found
