"""Parameters that several baselines have."""

from __future__ import annotations

from systems.framework.parameters import NonNegativeLength, Parameters


class MapParameters(Parameters):
    """Of baselines that look at a map of echoes."""

    clearance_m: NonNegativeLength = 0.05
    """Distance kept from places of echoes, m."""
    source_clearance_m: NonNegativeLength = 0.5
    """Echoes within this distance of the target count as echoes of the target, m."""
