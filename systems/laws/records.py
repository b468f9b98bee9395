"""What the laws that follow or search for a sound, or an odour, say of themselves."""

from __future__ import annotations

import math

from systems.laws.law import Equation, Law, Tuning
from systems.laws.parameters import (
    Active2017Parameters,
    ActiveParameters,
    Conventional2017Parameters,
    ConventionalParameters,
    GuardedParameters,
)

NONE = Law(
    name="none",
    title="No avoidance",
    label="no avoidance",
    equations=(Equation("No avoidance", r"f = 0", "f = 0"),),
    module="systems.laws.no_avoidance",
    force_name="no_force",
)

CONVENTIONAL = Law(
    name="conventional",
    title="Conventional law",
    label="conventional",
    equations=(
        Equation(
            "Conventional law (Han 2019, eq. 19-a)",
            r"f = K_0\,(\rho_0-c)+D_0\,s\quad (c<\rho_0),"
            r"\quad f = 0\quad (c\geq\rho_0)",
            "f = K_0 (rho_0 - c) + D_0 s for c < rho_0, else 0",
        ),
    ),
    module="systems.laws.conventional_impedance_controller",
    force_name="conventional_force",
    controller_name="ConventionalImpedanceController",
    gains=ConventionalParameters,
    loop_gains=("stiffness_n_m", "damping_n_s_m"),
    tuning=Tuning(
        rule="barrier",
        stiffest=lambda gains, least_range_m: gains.stiffness_n_m,
        sets_follow_distance=True,
    ),
)

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
    module="systems.laws.active_impedance_controller",
    force_name="active_force",
    controller_name="ActiveImpedanceController",
    gains=ActiveParameters,
    loop_gains=("reference_stiffness_n_m", "reference_damping_n_s_m"),
    tuning=Tuning(
        rule="matched",
        # k_ref/e^2, at 2 alpha.
        stiffest=lambda gains, least_range_m: (
            gains.reference_stiffness_n_m * math.exp(-2.0)
        ),
        # The velocity term is d_ref mu_0 at rest, and off from mu_0 on.
        spring_speed=lambda gains: gains.speed_limit_m_s,
        sets_follow_distance=True,
    ),
)

CONVENTIONAL_2017 = Law(
    name="conventional2017",
    title="Conventional law of 2017",
    label="conventional 2017",
    equations=(
        Equation(
            "Conventional law of 2017 (Kim 2017, eq. 20)",
            r"f = \frac{K_0}{\max(c,\,c_{min})}+D_0\,s",
            "f = K_0/max(c, c_min) + D_0 s, c_min the sensors' least range",
        ),
    ),
    module="systems.laws.conventional_impedance_2017_controller",
    force_name="conventional_2017_force",
    controller_name="ConventionalImpedance2017Controller",
    least_range=True,
    gains=Conventional2017Parameters,
    loop_gains=("distance_gain_j", "damping_n_s_m"),
    tuning=Tuning(
        rule="barrier",
        # K_0/c^2 just outside of the least range.
        stiffest=lambda gains, least_range_m: gains.distance_gain_j / least_range_m**2,
    ),
)

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
    module="systems.laws.active_impedance_2017_controller",
    force_name="active_2017_force",
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

GUARDED = Law(
    name="guarded",
    title="Guarded law",
    label="guarded",
    equations=(
        Equation(
            "Guarded law: wanted speed and yaw rate",
            r"v=k_v\,(\ell-d_f)+k_s\,\dot{\ell}_S,"
            r"\quad\omega=k_\omega\,(\varphi_c-\theta+A\sin\frac{2\pi t}{T_w})",
            "v = k_v (l - d_f) + k_s v_S, w = k_w (phi_c - theta + A sin(2 pi t/T_w))",
        ),
    ),
    module="systems.laws.guarded_controller",
    controller_name="GuardedController",
    gains=GuardedParameters,
    plans=True,
    guarded=True,
)

PLUME_SEARCH = Law(
    name="plume_search",
    title="Search for an odor source by smell and wind (Song 2011)",
    label="plume search",
    equations=(
        Equation(
            "Heading after a stop, upwind_gradient",
            r"\beta=\alpha+\psi_{up}+\mathrm{clip}(k\,\ln(C_1/C_3),\pm 45^\circ)",
            "beta = alpha + psi_up + clip(k ln(C1/C3), 45 deg)",
        ),
    ),
    plans=True,
    searches="odor",
)

SOUND_SEARCH = Law(
    name="sound_search",
    title="Search for a calling robot by four microphones (Song 2011)",
    label="sound search",
    equations=(
        Equation(
            "Heading after a stop",
            r"\beta=\alpha+\theta",
            "beta = alpha + theta",
        ),
    ),
    plans=True,
    searches="sound",
)
