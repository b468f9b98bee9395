"""Poles against one gain at a time: of the target loop, and in contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.linear.contact_mode import contact_matrix
from analysis.models.force_field import ForceField
from analysis.models.ideal_loop import ideal_loop
from analysis.models.ideal_scenarios import frozen_scenario, ideal_scenario
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.catalogue import LAWS

#: Gains that are tried, over today's.
_FACTORS = np.geomspace(0.05, 20.0, 121)
#: Distances at which a law's slopes are taken, m.
_DISTANCES_M = np.linspace(0.02, 2.0, 397)


@dataclass(frozen=True)
class ContactSlopes:
    """The spring and the damper that a law is to P before an obstacle at rest."""

    distance_m: float
    """Where the spring is stiffest, m."""
    stiffness_n_m: float
    """-df/dc there, N/m."""
    approach_damping_n_s_m: float
    """df/ds there at s = 0, for an obstacle that comes nearer, N s/m."""


@dataclass(frozen=True)
class RootLocus:
    """Poles of the sampled motion along one line against one gain."""

    parameter: str
    """Field of the scenario."""
    loop: str
    """``target`` away from obstacles, ``contact`` before one at rest, while it
    comes nearer."""
    values: NDArray[np.float64]
    """(n,) of the gain, ascending, SI units."""
    poles: NDArray[np.complex128]
    """(n, m) in the s plane, ln(z)/T, rad/s; delays left out as -infinity."""
    today: float
    """The scenario's value."""
    poles_today: NDArray[np.complex128]
    """(m,) with it."""

    @property
    def stable(self) -> NDArray[np.bool_]:
        """(n,) whether all decay."""
        return np.asarray((self.poles.real < 0.0).all(axis=1))

    @property
    def limit(self) -> float | None:
        """Largest of the values above today's up to which all are stable."""
        above = np.flatnonzero((self.values >= self.today) & ~self.stable)
        if not len(above):
            return None
        return float(self.values[max(above[0] - 1, 0)])


def contact_slopes(scenario: Scenario) -> ContactSlopes:
    """Slopes of the scenario's law where it is stiffest, from its controller.

    Raises:
        InputError: The law does not push, so that there is no contact.
    """
    field = ForceField(ideal_loop(frozen_scenario(ideal_scenario(scenario))))
    forces = field.law(_DISTANCES_M)
    slope = -np.gradient(forces, _DISTANCES_M)
    stiffest = int(slope.argmax())
    if slope[stiffest] <= 0.0:
        raise InputError(
            "law",
            f"{scenario.only.law!r} does not push off obstacles and has no contact "
            "mode; use another law",
        )
    c = float(_DISTANCES_M[stiffest])
    return ContactSlopes(c, float(slope[stiffest]), field.approach_damping(c))


def root_loci(scenario: Scenario) -> tuple[RootLocus, ...]:
    """Against K_r and D_r, and the gains of the law's two terms, if it has them."""
    attraction = scenario.follower.attraction
    K, D = attraction.stiffness_n_m, attraction.damping_n_s_m

    def locus(
        parameter: str,
        loop: str,
        today: float,
        matrix: Callable[[float], NDArray[np.float64]],
    ) -> RootLocus:
        values = _FACTORS * (today if today > 0.0 else 1.0)
        return RootLocus(
            parameter=parameter,
            loop=loop,
            values=values,
            poles=np.array(
                [_poles(matrix(float(value)), scenario.tick_s) for value in values]
            ),
            today=today,
            poles_today=_poles(matrix(today), scenario.tick_s),
        )

    target = (
        locus(
            "attraction.stiffness_n_m",
            "target",
            K,
            lambda value: contact_matrix(scenario, value),
        ),
        locus(
            "attraction.damping_n_s_m",
            "target",
            D,
            lambda value: contact_matrix(scenario, K, damping_n_s_m=value),
        ),
    )
    record = LAWS.get(scenario.only.law)
    if record is None or record.loop_gains is None:
        return target
    slopes = contact_slopes(scenario)
    k, d = slopes.stiffness_n_m, slopes.approach_damping_n_s_m
    law = getattr(scenario.follower.laws, scenario.only.law)
    spring, damper = record.loop_gains
    today, strength = getattr(law, spring), getattr(law, damper)
    return (
        *target,
        locus(
            f"laws.{scenario.only.law}.{spring}",
            "contact",
            today,
            lambda value: contact_matrix(scenario, K + k * value / today),
        ),
        locus(
            f"laws.{scenario.only.law}.{damper}",
            "contact",
            strength,
            lambda value: contact_matrix(
                scenario, K + k, approach_damping_n_s_m=d * value / strength
            ),
        ),
    )


def _poles(matrix: NDArray[np.float64], tick_s: float) -> NDArray[np.complex128]:
    z = np.linalg.eigvals(matrix).astype(complex)
    z[np.abs(z) < 1e-9] = 0.0
    gone = z == 0.0
    poles = np.log(np.where(gone, 1.0, z)) / tick_s
    poles[gone] = -np.inf
    return np.sort_complex(poles)
