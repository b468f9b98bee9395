"""The active virtual-impedance law of 2017."""

from __future__ import annotations

from typing import Any

from systems.laws.law_controller import define_law_controller
from systems.laws.parameters import Active2017Parameters
from systems.laws.records import ACTIVE_2017


def active_2017_force(c: Any, s: Any, gains: Active2017Parameters) -> Any:
    """K_a(c)/c + D_a(s) s: inverse distance, both terms saturating.

    Kim 2017 gives eq. 21 and, in words, K_a and D_a (figure 6): the push must
    saturate below rho_1, the speed term above mu_1. Our reading: K_a is K_0
    from rho_1 on and K_0 c/rho_1 below; D_a is D_0 up to mu_1 and D_0 mu_1/s
    above. The text says that K *increases* down to rho_1: so does the push.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, rho_1, D_0, mu_1.

    Returns:
        Force away from the obstacle, N: K_0/max(c, rho_1) + D_0 min(s, mu_1).
        At contact, at rest, it is K_0/rho_1. There is no end to its reach: it
        halves when the distance doubles.
    """
    near, fast = gains.saturation_distance_m, gains.saturation_speed_m_s
    spring = gains.distance_gain_j / (c if c > near else near + 0.0 * c)
    return spring + gains.damping_n_s_m * (s if s < fast else fast + 0.0 * s)


ActiveImpedance2017Controller_ = define_law_controller(
    "ActiveImpedance2017Controller",
    __name__,
    ACTIVE_2017,
    about="pushes off by inverse distance, up to a limit",
    reference="Kim 2017, eq. 19 (F_m), 21 and figure 6 in words",
)
ActiveImpedance2017Controller = ActiveImpedance2017Controller_[None]
