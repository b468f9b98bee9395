"""The laws of the package, in the order of all lists."""

from __future__ import annotations

from collections.abc import Mapping

from systems.laws.active import ACTIVE
from systems.laws.active_2017 import ACTIVE_2017
from systems.laws.conventional import CONVENTIONAL
from systems.laws.conventional_2017 import CONVENTIONAL_2017
from systems.laws.dynamic_window import DWA
from systems.laws.guarded import GUARDED
from systems.laws.law import Law
from systems.laws.no_avoidance import NONE
from systems.laws.path_integral import MPPI
from systems.laws.reciprocal_avoidance import ORCA
from systems.laws.searches import PLUME_SEARCH, SOUND_SEARCH
from systems.laws.stop_when_near import STOP_WHEN_NEAR
from systems.laws.trajectory.trajectory_adaptive import TRAJECTORY_ADAPTIVE
from systems.laws.trajectory.trajectory_conventional import TRAJECTORY_CONVENTIONAL
from systems.laws.trajectory.trajectory_filtered import TRAJECTORY_FILTERED
from systems.laws.vector_field_histogram import VFH_PLUS

#: The laws of the package by name.
LAWS: Mapping[str, Law] = {
    law.name: law
    for law in (
        NONE,
        CONVENTIONAL,
        ACTIVE,
        CONVENTIONAL_2017,
        ACTIVE_2017,
        GUARDED,
        STOP_WHEN_NEAR,
        DWA,
        VFH_PLUS,
        MPPI,
        ORCA,
        TRAJECTORY_CONVENTIONAL,
        TRAJECTORY_ADAPTIVE,
        TRAJECTORY_FILTERED,
        PLUME_SEARCH,
        SOUND_SEARCH,
    )
}

#: Names of the laws that compute a force on the virtual mass. The analyses compare
#: these laws.
FORCE_LAWS = tuple(name for name, law in LAWS.items() if law.force is not None)
#: Names of the laws for robots that drive on planned routes.
ROUTE_LAWS = tuple(name for name, law in LAWS.items() if law.robot == "router")


def law_title(name: str) -> str:
    """Returns the heading of a law in reports, which is the name for a user's law."""
    return LAWS[name].title if name in LAWS else name
