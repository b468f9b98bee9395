"""Parameters of the attraction, and the choice of the velocity term of the laws."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import (
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
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
