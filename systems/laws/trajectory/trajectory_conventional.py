"""The law of Engelbrecht 2021 with restored signs: impedance to a moving target."""

from __future__ import annotations

from systems.framework.parameters import Length, NonNegativeStiffness, Parameters
from systems.laws.law import Equation, Law
from systems.laws.parameters import ImpedanceParameters


class TrajectoryImpedanceParameters(ImpedanceParameters):
    """Springs and dampers from the robot to the target and to contacts."""

    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """Stiffness K_e to robots and obstacles, N/m."""
    security_zone_m: Length = 1.0
    """Distance S from P at which contacts begin, m (1 m in tables 1 and 2)."""

    @property
    def damping_fades(self) -> bool:
        """Whether the damping of a contact is 0 at the edge of the security zone.

        If true, the damping grows from the edge toward the object. If false, the full
        damping acts in the whole zone, as the paper prints it.
        """
        return False

    @property
    def zone_narrows(self) -> bool:
        """Whether the zone of objects at rest is at most the clearance of the route.

        If true, obstacles that the planner knows do not push a robot on its route.
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

    ``name`` is the name in scenarios, ``title`` the heading in reports, and ``label``
    the label in legends. ``impedance`` is the class of all parameters, and ``gains``
    the class of those that only this law has. The record lists the equation of motion,
    then the equations ``more``.
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
