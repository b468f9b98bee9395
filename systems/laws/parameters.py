"""Parameters of attraction and impedance, and the choice of the velocity term."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import (
    Damping,
    Length,
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
    Stiffness,
)

#: Definition of the speed s of an obstacle. With ``printed``, s is |dC/dt|, the rate of
#: change of the collision vector C. With ``closing``, s is the speed of approach.
VelocityTerm = Literal["printed", "closing"]


class AttractionParameters(Parameters):
    """The spring and damper to the target (Han 2019, eq. 18 and section 5)."""

    stiffness_n_m: NonNegativeStiffness = 2.0
    """Stiffness K_r, N/m (printed without unit)."""
    damping_n_s_m: NonNegativeDamping = 1.0
    """Damping D_r, N s/m (the paper prints no unit). With the stiffness K_r = 2 N/m and
    a virtual mass of 3.94 kg, the damping ratio is 0.18."""
    follow_distance_m: NonNegativeLength = 1.2
    """Follow distance d_f from the source, m (our choice). At this distance, the spring
    has no force. The paper uses 0: the spring pulls the control point P onto the
    source."""


class ImpedanceParameters(Parameters):
    """Springs and dampers from a robot on a route to its target and to contacts.

    K and D are the stiffness and damping to the target, and K_e and D_e are those to
    contacts. Contacts begin at the distance S. K, D, and S have the values of tables 1
    and 2 of Engelbrecht, Steyn and Djouani (2021). The paper prints only one stiffness
    and one damping. Therefore K_e = K and D_e = D by default.
    """

    stiffness_n_m: Stiffness = 3.0
    """Stiffness K to the target, N/m (tables 1 and 2)."""
    damping_n_s_m: Damping = 4.0
    """Damping D to the target, N s/m (tables 1 and 2)."""
    contact_stiffness_n_m: NonNegativeStiffness | None = None
    """Stiffness K_e to robots and obstacles, N/m. With null, the stiffness is 8 N/m for
    the law ``trajectory_filtered`` (our choice) and 3 N/m for other laws."""
    contact_damping_n_s_m: NonNegativeDamping = 4.0
    """Damping D_e to robots and obstacles, N s/m."""
    security_zone_m: Length | None = None
    """Distance S from the control point P at which contacts begin, m. With null, the
    distance is 0.8 m for the law ``trajectory_filtered`` (our choice) and 1 m for other
    laws (tables 1 and 2). With ``trajectory_filtered``, the clearance of the route near
    P limits the distance."""
    block_distance_m: Length | None = None
    """Distance L_block of eq. 6 of Engelbrecht 2021, m. With null, eq. 6 is off.

    With eq. 6, the control point P stops if its next step would end within this
    distance of an object and would not lead away from the object.

    The paper prints no value. A distance of 0.2 m is enough for ``turtlebot3_burger``,
    whose rear corners are 0.174 m from P.
    """
