"""The active virtual-impedance law of Kim 2017: gains, force, and equation."""

from __future__ import annotations

from typing import Any

from systems.framework.parameters import Damping, Length, Parameters, Positive, Speed
from systems.laws.law import Equation, Law, Tuning


class Active2017Parameters(Parameters):
    """Gains of a law whose push grows near the obstacle (Kim 2017, eq. 21, fig. 6).

    The push is the part of the force that depends on the distance. It grows as the
    distance falls to rho_1, and is constant at smaller distances. Kim 2017 does not
    print the gains.
    """

    distance_gain_j: Positive = 1.22
    """Gain K_0 of the push K_0/c, J. Han's laws use the symbol K_0 for a stiffness."""
    saturation_distance_m: Length = 0.1
    """Distance rho_1 below which the push stays at K_0/rho_1, m (Kim 2017, 5)."""
    damping_n_s_m: Damping = 0.8
    """Damping D_0, N s/m."""
    saturation_speed_m_s: Speed = 0.72
    """Speed mu_1 above which the velocity term is constant, m/s.

    Kim 2017 (section 5) prints no value: mu_1 was chosen by trial, so that the robot
    stays below 720 mm/s. The default is these 720 mm/s.
    """


def active_2017_force(c: Any, s: Any, gains: Active2017Parameters) -> Any:
    """Computes the saturating force K_0/max(c, rho_1) + D_0 min(s, mu_1).

    Kim 2017 prints the force as K_a(c)/c + D_a(s) s (eq. 21). The paper describes K_a
    and D_a only in words and in figure 6: the push K_a/c is constant below the distance
    rho_1, and the velocity term D_a s is constant above the speed mu_1. We therefore
    choose:

    - K_a is K_0 above rho_1, and K_0 c/rho_1 below rho_1.
    - D_a is D_0 below mu_1, and D_0 mu_1/s above mu_1.

    According to the paper, the gain K_a increases while c falls to rho_1. With our
    choice, K_a is constant in this range, and only the push K_a/c increases.

    The push has no limit of reach. At twice the distance, it is half as large.

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Speed of the obstacle, m/s.
        gains: Gains of the law.

    Returns:
        Force away from the obstacle, N.
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
    tuning=Tuning(rule="barrier"),
)
