"""The law of Engelbrecht 2021 with restored signs: impedance to a moving target."""

from __future__ import annotations

from systems.framework.parameters import Length, NonNegativeStiffness, Parameters
from systems.laws.law import Equation, Law
from systems.laws.parameters import ImpedanceParameters


class TrajectoryImpedanceParameters(ImpedanceParameters):
    """Springs and dampers that act from the target and from contacts."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """Stiffness K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """Distance S from P at which contacts begin, m (1 m in tables 1 and 2)."""

    @property
    def damping_fades(self) -> bool:
        """Whether the damping of a contact is 0 at the edge of the zone.

        If true, the damping grows from the edge toward the object. If false, the full
        damping acts in the whole zone, as printed.
        """
        return False


def trajectory_law(
    name: str,
    title: str,
    label: str,
    impedance: type[TrajectoryImpedanceParameters],
    *more: Equation,
    gains: type[Parameters] | None = None,
) -> Law:
    """Makes the record of a law whose block is ``TrajectoryImpedanceController``.

    Args:
        name: Name of the law in scenarios.
        title: Heading in reports.
        label: Label in the legends of pictures.
        impedance: Model of the parameters of the block.
        *more: Equations that follow the equation of motion.
        gains: Model of those parameters that only this law has.

    Returns:
        Record of the law.
    """
    motion = Equation(
        "Impedance to the target and to contacts",
        r"M\ddot{p}=-K(p-p_d)-D(v-v_d)+\sum_j K_e(S-d_j)\,n_j-D_e(v-v_j)",
        "M p'' = -K (p - p_d) - D (v - v_d) + sum K_e (S - d_j) n_j - D_e (v - v_j)",
    )
    return Law(
        name=name,
        title=title,
        label=label,
        equations=(motion, *more),
        gains=gains,
        impedance=impedance,
        controller_name="TrajectoryImpedanceController",
        robot="router",
    )


TRAJECTORY_CONVENTIONAL = trajectory_law(
    "trajectory_conventional",
    "Trajectory impedance (Engelbrecht et al. 2021)",
    "trajectory, conventional",
    TrajectoryImpedanceParameters,
)
