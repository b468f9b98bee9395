"""Optimal reciprocal collision avoidance (ORCA): gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import Duration, Length, Parameters
from systems.laws.law import Equation, Law


class ReciprocalAvoidanceParameters(Parameters):
    """Horizon of ORCA, and the point that it moves."""

    horizon_s: Duration = 1.8
    """Time for which the chosen velocity avoids contacts, s."""
    offset_m: Length = 0.045
    """Distance ahead of the axle of the point whose velocity ORCA chooses, m."""


ORCA = Law(
    name="orca",
    title="ORCA with perfect knowledge (van den Berg et al. 2011)",
    label="ORCA",
    equations=(
        Equation(
            "ORCA: velocity of the point ahead of the axle",
            r"v=\mathrm{argmin}\,|v-v^{pref}|"
            r"\quad\mathrm{with}\quad n_i\cdot(v-v_i-u_i)\geq 0",
            "v = argmin |v - v_pref| with n_i . (v - v_i - u_i) >= 0",
        ),
    ),
    controller_name="ReciprocalAvoidanceController",
    gains=ReciprocalAvoidanceParameters,
)
