"""Stop when near: gains, equation, and record."""

from __future__ import annotations

from systems.framework.parameters import Length, Parameters
from systems.laws.law import Equation, Law


class StopWhenNearParameters(Parameters):
    """When the robot stops."""

    stop_m: Length = 0.6
    """Distance below which an echo stops the robot, m."""


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
)
