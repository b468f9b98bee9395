"""Gains of the repulsion laws, one set a law.

K_0, k_ref, D_0 and d_ref are not printed in the papers. These defaults are what
``phonotaxis design`` derives from stated requirements, the same for each law;
docs/design.md explains.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Literal

from pydantic import model_validator

from systems.framework.input_error import InputError
from systems.framework.parameters import (
    Damping,
    Length,
    Parameters,
    Positive,
    Speed,
    Stiffness,
)

__all__ = [
    "Active2017Parameters",
    "ActiveParameters",
    "Conventional2017Parameters",
    "ConventionalParameters",
    "RepulsionParameters",
    "VelocityTerm",
    "matched_decay",
]

VelocityTerm = Literal["printed", "closing"]


def matched_decay(limit: float, ratio: float) -> float:
    """limit / (2 ln ratio): both laws are equal at half the limit."""
    return limit / (2.0 * math.log(ratio))


class ConventionalParameters(Parameters):
    """Spring and damper within a reach (Han 2019, eq. 19-a)."""

    stiffness_n_m: Stiffness = 12.3
    """K_0, N/m."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""
    reach_m: Length = 0.8
    """rho_0: the law acts below this distance, m (Han 2019, 5.2)."""


class ActiveParameters(Parameters):
    """Spring and damper that vary with distance and speed (Han 2019, eq. 20-22).

    alpha and beta make the law equal to a conventional one with ``matched``
    gains at half the reach and at half the speed limit.
    """

    reference_stiffness_n_m: Stiffness = 84.5
    """k_ref, N/m, above K_0."""
    matched_stiffness_n_m: Stiffness = 17.1
    """K_0, N/m: the push at rho_0/2 is K_0 rho_0/2."""
    reach_m: Length = 0.8
    """rho_0, m (Han 2019, 5.2); the law itself has no end."""
    reference_damping_n_s_m: Damping = 0.0811
    """d_ref, N s/m, below D_0."""
    matched_damping_n_s_m: Damping = 0.839
    """D_0, N s/m: the velocity term at mu_0/2 is D_0 mu_0/2."""
    speed_limit_m_s: Speed = 0.72
    """mu_0: the velocity term acts below this speed, m/s (5.3)."""

    @model_validator(mode="after")
    def _check(self) -> ActiveParameters:
        if self.reference_stiffness_n_m <= self.matched_stiffness_n_m:
            raise InputError(
                "reference_stiffness_n_m",
                f"{self.reference_stiffness_n_m} (k_ref) is "
                f"not above matched_stiffness_n_m {self.matched_stiffness_n_m} (K_0), "
                "and alpha = rho_0 / (2 ln(k_ref/K_0)) must be positive; raise it",
            )
        if self.reference_damping_n_s_m >= self.matched_damping_n_s_m:
            raise InputError(
                "reference_damping_n_s_m",
                f"{self.reference_damping_n_s_m} (d_ref) is "
                f"not below matched_damping_n_s_m {self.matched_damping_n_s_m} (D_0), "
                "and beta = mu_0 / (2 ln(D_0/d_ref)) must be positive; lower it",
            )
        return self

    @cached_property
    def alpha_m(self) -> float:
        """Decay length of the spring, m (Han 2019, eq. 21)."""
        ratio = self.reference_stiffness_n_m / self.matched_stiffness_n_m
        return matched_decay(self.reach_m, ratio)

    @cached_property
    def beta_m_s(self) -> float:
        """Growth speed of the damper, m/s (eq. 22, misprinted)."""
        ratio = self.matched_damping_n_s_m / self.reference_damping_n_s_m
        return matched_decay(self.speed_limit_m_s, ratio)


class Conventional2017Parameters(Parameters):
    """Push that grows with nearness without a bound (Kim 2017, eq. 20).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 0.917
    """K_0, N m: the push is K_0/c. Not the K_0 of Han's laws."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""


class Active2017Parameters(Parameters):
    """Push that grows with nearness and saturates (Kim 2017, eq. 21, fig. 6).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 1.22
    """K_0, N m: the push is K_0/c. Not the K_0 of Han's laws."""
    saturation_distance_m: Length = 0.1
    """rho_1: nearer than this the push stays at K_0/rho_1, m (Kim 2017, 5)."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""
    saturation_speed_m_s: Speed = 0.72
    """mu_1: faster than this the velocity term stays at D_0 mu_1, m/s. Kim 2017, 5
    chooses it by trial so that the robot stays below 720 mm/s, and prints no
    value; ours is that speed."""


class RepulsionParameters(Parameters):
    """What pushes the robot off obstacles; each law reads its own set."""

    velocity_term: VelocityTerm = "printed"
    """s = |dC/dt| as printed, or ``closing``: the speed of approach alone."""
    conventional: ConventionalParameters = ConventionalParameters()
    """Gains of ``law: conventional``."""
    active: ActiveParameters = ActiveParameters()
    """Gains of ``law: active``."""
    conventional2017: Conventional2017Parameters = Conventional2017Parameters()
    """Gains of ``law: conventional2017``."""
    active2017: Active2017Parameters = Active2017Parameters()
    """Gains of ``law: active2017``."""
