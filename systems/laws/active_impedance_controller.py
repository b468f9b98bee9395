"""The active virtual-impedance law of 2019."""

from __future__ import annotations

from typing import Any

from systems.framework.scalar_math import exp
from systems.laws.law_controller import define_law_controller
from systems.laws.parameters import ActiveParameters
from systems.laws.records import ACTIVE


def active_force(c: Any, s: Any, gains: ActiveParameters) -> Any:
    """k_ref exp(-c/alpha) c + d_ref exp(s/beta) (mu_0 - s) (Han 2019, eq. 20).

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s; from mu_0 on the second term is 0 (table 4).
        gains: k_ref, d_ref, mu_0, and K_0, D_0, rho_0 through alpha, beta.

    Returns:
        Force away from the obstacle, N. The first term is bounded, largest at
        c = alpha, and zero at contact; the second is d_ref mu_0 at rest, at
        any distance. Eq. 19-b multiplies K_0(c) by (rho_0 - c) once more; eq.
        20 and table 4 are the consistent reading.
    """
    spring = gains.reference_stiffness_n_m * exp(-c / gains.alpha_m) * c
    if s >= gains.speed_limit_m_s:
        return spring
    damper = gains.reference_damping_n_s_m * exp(s / gains.beta_m_s)
    return spring + damper * (gains.speed_limit_m_s - s)


ActiveImpedanceController_ = define_law_controller(
    "ActiveImpedanceController",
    __name__,
    ACTIVE,
    about="pushes off by distance and speed at any distance",
    reference="Han 2019, eq. 18 (F_m), 20-22 and table 4",
)
ActiveImpedanceController = ActiveImpedanceController_[None]
