"""Root loci: poles as functions of one gain, in the target loop and in contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.loops.contact_mode import contact_model
from analysis.loops.linear_models import LinearModel
from analysis.loops.radial_law import radial_law
from diagrams.scenario.scenario import Scenario
from systems.laws.catalog import LAWS

#: Factors on the scenario's gain.
_FACTORS = np.geomspace(0.05, 20.0, 121)


@dataclass(frozen=True)
class RootLocus:
    """Poles of the sampled motion along one line, as functions of one gain."""

    parameter: str
    """Field of the scenario that is varied."""
    loop: str
    """``target``: far from obstacles. ``contact``: approaching an obstacle at rest."""
    values: NDArray[np.float64]
    """(n,) ascending values of the gain in SI units."""
    poles: NDArray[np.complex128]
    """(n, m) poles ln(z)/T in the s plane, rad/s. Pure delays (z = 0) are -infinity."""
    today: float
    """Gain in the scenario."""
    poles_today: NDArray[np.complex128]
    """(m,) poles at the gain of the scenario."""

    @property
    def stable(self) -> NDArray[np.bool_]:
        """(n,) whether all poles decay."""
        return np.asarray((self.poles.real < 0.0).all(axis=1))

    @property
    def limit(self) -> float | None:
        """Largest value above the scenario's up to which all values are stable."""
        above = np.flatnonzero((self.values >= self.today) & ~self.stable)
        if not len(above):
            return None
        return float(self.values[max(above[0] - 1, 0)])


def root_loci(scenario: Scenario) -> tuple[RootLocus, ...]:
    """Returns root loci over the stiffness K_r and the damping D_r of the attraction.

    If the repulsion has a spring term and a damping term, the result also has a root
    locus over the gain of each term.

    Args:
        scenario: Scenario with gains, robot and plant.

    Returns:
        Two or four root loci.
    """
    attraction = scenario.follower.attraction
    K, D = attraction.stiffness_n_m, attraction.damping_n_s_m

    def locus(
        parameter: str,
        loop: str,
        today: float,
        model: Callable[[float], LinearModel],
    ) -> RootLocus:
        values = _FACTORS * (today if today > 0.0 else 1.0)
        return RootLocus(
            parameter=parameter,
            loop=loop,
            values=values,
            poles=np.array([_poles(model(float(value))) for value in values]),
            today=today,
            poles_today=_poles(model(today)),
        )

    target = (
        locus(
            "attraction.stiffness_n_m",
            "target",
            K,
            lambda value: contact_model(scenario, value),
        ),
        locus(
            "attraction.damping_n_s_m",
            "target",
            D,
            lambda value: contact_model(scenario, K, damping_n_s_m=value),
        ),
    )
    record = LAWS.get(scenario.only.law)
    if record is None or record.loop_gains is None:
        return target
    force = radial_law(scenario)
    distance, k = force.stiffest
    _, d = force.gradient(distance, 0.0)
    law = getattr(scenario.follower.laws, scenario.only.law)
    spring, damper = record.loop_gains
    today, strength = getattr(law, spring), getattr(law, damper)
    return (
        *target,
        locus(
            f"laws.{scenario.only.law}.{spring}",
            "contact",
            today,
            lambda value: contact_model(scenario, K + k * value / today),
        ),
        locus(
            f"laws.{scenario.only.law}.{damper}",
            "contact",
            strength,
            lambda value: contact_model(
                scenario, K + k, approach_damping_n_s_m=d * value / strength
            ),
        ),
    )


def _poles(model: LinearModel) -> NDArray[np.complex128]:
    poles = np.sort_complex(model.s_poles)
    delays = np.full(len(model.A) - len(poles), -np.inf, dtype=np.complex128)
    return np.concatenate([delays, poles])
