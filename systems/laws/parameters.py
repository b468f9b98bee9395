"""The attraction, and the definition of s that the laws share."""

from __future__ import annotations

from typing import Literal

from systems.framework.parameters import (
    NonNegativeDamping,
    NonNegativeLength,
    NonNegativeStiffness,
    Parameters,
)

#: Definition of the speed s of an obstacle: ``printed`` is |dC/dt|, ``closing`` is the
#: speed of approach only.
VelocityTerm = Literal["printed", "closing"]


class AttractionParameters(Parameters):
    """The spring and damper to the target (Han 2019, eq. 18 and section 5)."""

    stiffness_n_m: NonNegativeStiffness = 2.0
    """Stiffness K_r, N/m (printed without unit)."""
    damping_n_s_m: NonNegativeDamping = 1.0
    """Damping D_r, N s/m (printed without unit). With K_r = 2 N/m the damping ratio
    is 0.18."""
    follow_distance_m: NonNegativeLength = 1.2
    """Distance d_f from the source at which the spring has no force, m (our choice).
    With 0, as in the paper, the spring pulls P onto the source."""
