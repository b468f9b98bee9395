"""The law of Engelbrecht 2021 with restored signs: impedance to a moving target."""

from __future__ import annotations

from systems.framework.parameters import (
    Damping,
    Length,
    NonNegativeDamping,
    NonNegativeStiffness,
    Parameters,
    Stiffness,
)
from systems.laws.law import Equation, Law


class TrajectoryImpedanceParameters(Parameters):
    """Springs and dampers from the robot to the target and to contacts.

    K and D are the stiffness and damping to the target, and K_e and D_e are those to
    contacts. Contacts begin at the distance S. K, D, and S have the values of tables 1
    and 2 of Engelbrecht, Steyn and Djouani (2021). The paper prints only one stiffness
    and one damping. Therefore K_e = K and D_e = D by default.
    """

    stiffness_n_m: Stiffness = 3.0
    """Stiffness K to the target, N/m (tables 1 and 2)."""
    damping_n_s_m: Damping = 4.0
    """Damping D to the target, N s/m (tables 1 and 2)."""
    contact_stiffness_n_m: NonNegativeStiffness = 3.0
    """Stiffness K_e to robots and obstacles, N/m."""
    contact_damping_n_s_m: NonNegativeDamping = 4.0
    """Damping D_e to robots and obstacles, N s/m."""
    security_zone_m: Length = 1.0
    """Distance S from P at which contacts begin, m (1 m in tables 1 and 2)."""
    block_distance_m: Length | None = None
    """Distance L_block of eq. 6 of Engelbrecht 2021, m. With null, eq. 6 is off.

    With eq. 6, the control point P stops if its next step would end within this
    distance of an object and would not lead away from the object.

    The paper prints no value. A distance of 0.2 m is enough for ``turtlebot3_burger``,
    whose rear corners are 0.174 m from P.
    """

    @property
    def damping_fades(self) -> bool:
        """Whether the damping of a contact is 0 at the edge of the security zone.

        If true, the damping grows from the edge toward the object. If false, the full
        damping acts in the whole zone, as the paper prints it.
        """
        return False


def trajectory_law(
    name: str,
    title: str,
    label: str,
    gains: type[TrajectoryImpedanceParameters],
    *more: Equation,
) -> Law:
    """Makes the record of a law whose block is ``TrajectoryImpedanceController``.

    ``name`` is the name in scenarios, ``title`` the heading in reports, and ``label``
    the label in legends. ``gains`` is the parameter class of the gains. The record
    lists the equation of motion, then the equations ``more``.
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
        controller_name="TrajectoryImpedanceController",
        robot="router",
    )


TRAJECTORY_CONVENTIONAL = trajectory_law(
    "trajectory_conventional",
    "Trajectory impedance (Engelbrecht et al. 2021)",
    "trajectory, conventional",
    TrajectoryImpedanceParameters,
)
