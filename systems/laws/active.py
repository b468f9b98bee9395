"""The active virtual-impedance law of Han 2019: gains, force, and equations."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

from pydantic import model_validator

from systems.framework.elementary import exp
from systems.framework.input_error import InputError
from systems.framework.parameters import Damping, Length, Parameters, Speed, Stiffness
from systems.laws.law import Equation, Law, Tuning


def matched_decay(limit: float, ratio: float) -> float:
    """Computes the decay constant of an exponential gain from the ratio of two gains.

    The gain is exp(x/decay) or exp(-x/decay). It changes by the factor ``ratio`` when x
    changes by half of ``limit``. Therefore the decay constant is limit/(2 ln ratio).
    ``limit`` is a distance in m or a speed in m/s, and the decay constant has the same
    unit. ``ratio`` is the larger gain divided by the smaller gain, above 1.
    """
    return limit / (2.0 * math.log(ratio))


def matched_share(limit: float, decay: float) -> float:
    """Computes the ratio exp(-limit/(2 decay)) of the smaller gain to the larger gain.

    The gain is exp(x/decay) or exp(-x/decay). It changes by this ratio when x changes
    by half of ``limit``. Therefore the result is 1/``ratio``, where ``ratio`` is the
    argument of ``matched_decay``. ``limit`` and ``decay`` have the same unit, m or m/s.
    """
    return math.exp(-limit / (2.0 * decay))


class ActiveParameters(Parameters):
    """Gains of a law whose stiffness and damping vary (Han 2019, eq. 20-22).

    The stiffness depends on the distance of the obstacle, and the damping depends on
    its speed. The decay constants alpha and beta follow from two requirements:

    - At the distance rho_0/2, the spring term is K_0 rho_0/2.
    - At the speed mu_0/2, the velocity term is D_0 mu_0/2.
    """

    reference_stiffness_n_m: Stiffness = 84.5
    """Stiffness k_ref, N/m, above K_0."""
    matched_stiffness_n_m: Stiffness = 17.1
    """Stiffness K_0, N/m. The spring term at the distance rho_0/2 is K_0 rho_0/2."""
    reach_m: Length = 0.8
    """Distance rho_0, m (Han 2019, 5.2). The law acts beyond it, too."""
    reference_damping_n_s_m: Damping = 0.0811
    """Damping d_ref, N s/m, below D_0."""
    matched_damping_n_s_m: Damping = 0.839
    """Damping D_0, N s/m. The velocity term at the speed mu_0/2 is D_0 mu_0/2."""
    speed_limit_m_s: Speed = 0.72
    """Speed mu_0 below which the velocity term acts, m/s (5.3)."""

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
        """Increase of s that raises the damping e-fold, m/s (eq. 22, misprinted)."""
        ratio = self.matched_damping_n_s_m / self.reference_damping_n_s_m
        return matched_decay(self.speed_limit_m_s, ratio)


def active_force(c: Any, s: Any, gains: ActiveParameters) -> Any:
    """Computes the force k_ref exp(-c/alpha) c + d_ref exp(s/beta) (mu_0 - s).

    This force is eq. 20 of Han 2019. The first term is the spring term. It is largest
    at c = alpha and zero at contact (c = 0). The second term is the velocity term. For
    an obstacle at rest (s = 0), it is d_ref mu_0 at any distance.

    Eq. 19-b of the paper has two more factors: (rho_0 - c) in the first term, and s in
    the second. This function follows eq. 20, because table 4 agrees with eq. 20.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Speed of the obstacle, m/s. For s >= mu_0, the velocity term is 0 (table 4).
        gains: Gains of the law.

    Returns:
        Force away from the obstacle, N.
    """
    spring = gains.reference_stiffness_n_m * exp(-c / gains.alpha_m) * c
    limit = gains.speed_limit_m_s
    if s >= limit:
        return spring
    damper = gains.reference_damping_n_s_m * exp(s / gains.beta_m_s)
    return spring + damper * (limit - s)


ACTIVE = Law(
    name="active",
    title="Active law of 2019",
    label="active 2019",
    equations=(
        Equation(
            "Active law of 2019 (Han 2019, eq. 20)",
            r"f = k_{ref}\,e^{-c/\alpha}\,c+d_{ref}\,e^{s/\beta}(\mu_0-s)"
            r"\;[s<\mu_0]",
            "f = k_ref exp(-c/alpha) c + d_ref exp(s/beta)(mu_0 - s) [s < mu_0]",
        ),
        Equation(
            "with",
            r"\alpha=\frac{\rho_0}{2\ln(k_{ref}/K_0)},"
            r"\quad\beta=\frac{\mu_0}{2\ln(D_0/d_{ref})}",
            "alpha = rho_0 / (2 ln(k_ref/K_0)), beta = mu_0 / (2 ln(D_0/d_ref))",
        ),
    ),
    force=active_force,
    controller_name="ActiveImpedanceController",
    gains=ActiveParameters,
    loop_gains=("reference_stiffness_n_m", "reference_damping_n_s_m"),
    tuning=Tuning(
        rule="matched",
        # The velocity term is d_ref mu_0 at rest. It is 0 at mu_0 and above.
        spring_speed=lambda gains: gains.speed_limit_m_s,
        sets_follow_distance=True,
    ),
)
