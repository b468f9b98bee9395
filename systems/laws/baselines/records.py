"""What the baselines say of themselves."""

from __future__ import annotations

from systems.laws.baselines.parameters import (
    DynamicWindowParameters,
    PathIntegralParameters,
    ReciprocalAvoidanceParameters,
    StopWhenNearParameters,
    VectorFieldHistogramParameters,
)
from systems.laws.law import Equation, Law

STOP_WHEN_NEAR = Law(
    name="stop_when_near",
    title="Stop when near",
    label="stop when near",
    equations=(
        Equation(
            "Stop when near: wanted speed",
            r"v=k_v\,(\ell-d_f)+k_s\,\dot{\ell}_S"
            r"\quad\mathrm{while\ all\ ranges}\geq r_0",
            "v = k_v (l - d_f) + k_s v_S while all ranges >= r_0, else 0",
        ),
    ),
    controller_name="StopWhenNearController",
    gains=StopWhenNearParameters,
    plans=True,
)

DWA = Law(
    name="dwa",
    title="Dynamic window approach (Fox, Burgard and Thrun 1997)",
    label="dynamic window",
    equations=(
        Equation(
            "Dynamic window approach: objective",
            r"G(v,\omega)=\alpha\,\mathrm{heading}+\beta\,\mathrm{dist}"
            r"+\gamma\,\mathrm{velocity}",
            "G(v, w) = alpha heading + beta dist + gamma velocity",
        ),
    ),
    controller_name="DynamicWindowController",
    gains=DynamicWindowParameters,
    plans=True,
)

VFH_PLUS = Law(
    name="vfh_plus",
    title="VFH+ (Ulrich and Borenstein 1998)",
    label="VFH+",
    equations=(
        Equation(
            "VFH+: cost of a candidate direction",
            r"g(c)=\mu_1\,\Delta(c,k_t)+\mu_2\,\Delta(c,\theta/\alpha)"
            r"+\mu_3\,\Delta(c,k_{n-1})",
            "g(c) = mu_1 D(c, k_t) + mu_2 D(c, theta/alpha) + mu_3 D(c, k_(n-1))",
        ),
    ),
    controller_name="VectorFieldHistogramController",
    gains=VectorFieldHistogramParameters,
    plans=True,
)

MPPI = Law(
    name="mppi",
    title="Model predictive path integral control (Williams et al. 2018)",
    label="MPPI",
    equations=(
        Equation(
            "MPPI: the plan",
            r"u_k=\sum_n w_n\,(u_k+\epsilon_k^n),"
            r"\quad w_n\propto\exp(-\frac{1}{\lambda}S_n)",
            "u_k = sum of w_n (u_k + e_k^n), w_n ~ exp(-S_n/lambda)",
        ),
    ),
    controller_name="PathIntegralController",
    gains=PathIntegralParameters,
    plans=True,
)

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
    plans=True,
)
