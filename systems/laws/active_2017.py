"""The active virtual-impedance law of Kim 2017: gains, force and equation."""

from __future__ import annotations

from typing import Any

from systems.framework.parameters import Damping, Length, Parameters, Positive, Speed
from systems.laws.law import Equation, Law, Tuning


class Active2017Parameters(Parameters):
    """Push that grows with nearness and saturates (Kim 2017, eq. 21, fig. 6).

    Kim 2017 prints neither gain.
    """

    distance_gain_j: Positive = 1.22
    """K_0, J: the push is K_0/c. Not the K_0 of Han's laws."""
    saturation_distance_m: Length = 0.1
    """rho_1: nearer than this the push stays at K_0/rho_1, m (Kim 2017, 5)."""
    damping_n_s_m: Damping = 0.8
    """D_0, N s/m."""
    saturation_speed_m_s: Speed = 0.72
    """mu_1: faster than this the velocity term stays at D_0 mu_1, m/s. Kim 2017, 5
    chooses it by trial so that the robot stays below 720 mm/s, and prints no value; the
    default is that speed."""


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
        At contact, at rest, it is K_0/rho_1. Its reach has no end: the push halves
        when the distance doubles.
    """
    near, fast = gains.saturation_distance_m, gains.saturation_speed_m_s
    spring = gains.distance_gain_j / (c if c > near else near + 0.0 * c)
    return spring + gains.damping_n_s_m * (s if s < fast else fast + 0.0 * s)


ACTIVE_2017 = Law(
    name="active2017",
    title="Active law of 2017",
    label="active 2017",
    equations=(
        Equation(
            "Active law of 2017 (Kim 2017, eq. 21)",
            r"f = \frac{K_a(c)}{c}+D_a(s)\,s,\quad K_a = K_0\min(1,\,c/\rho_1),"
            r"\quad D_a = D_0\min(1,\,\mu_1/s)",
            "f = K_a(c)/c + D_a(s) s, K_a = K_0 min(1, c/rho_1), "
            "D_a = D_0 min(1, mu_1/s)",
        ),
    ),
    force=active_2017_force,
    controller_name="ActiveImpedance2017Controller",
    gains=Active2017Parameters,
    loop_gains=("distance_gain_j", "damping_n_s_m"),
    tuning=Tuning(
        rule="barrier",
        # K_0/c^2 just outside of rho_1.
        stiffest=lambda gains, least_range_m: (
            gains.distance_gain_j / gains.saturation_distance_m**2
        ),
    ),
)
