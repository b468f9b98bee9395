"""The conventional virtual-impedance law."""

from __future__ import annotations

from typing import Any

from systems.laws.law_controller import define_law_controller
from systems.laws.parameters import ConventionalParameters
from systems.laws.records import CONVENTIONAL


def conventional_force(c: Any, s: Any, gains: ConventionalParameters) -> Any:
    """K_0 (rho_0 - c) + D_0 s below rho_0, else 0 (Han 2019, eq. 19-a).

    Args:
        c: Distance of the obstacle, m; float or AutoDiffXd.
        s: Its speed, m/s.
        gains: K_0, D_0, rho_0.

    Returns:
        Force away from the obstacle, N. It steps by D_0 s at rho_0.
    """
    if c < gains.reach_m:
        return gains.stiffness_n_m * (gains.reach_m - c) + gains.damping_n_s_m * s
    return 0.0 * c


ConventionalImpedanceController_ = define_law_controller(
    "ConventionalImpedanceController",
    __name__,
    CONVENTIONAL,
    about="pushes off linearly within rho_0",
    reference="Han 2019, eq. 18 (F_m) and 19-a",
)
ConventionalImpedanceController = ConventionalImpedanceController_[None]
