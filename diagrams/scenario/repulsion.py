"""The gains of all laws, one set per law.

The papers do not print K_0, k_ref, D_0, and d_ref. The command ``phonotaxis design``
derives the defaults from requirements, which are the same for each law.
docs/avoidance.md explains these requirements.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from systems.framework.parameters import Parameters
from systems.laws.catalogue import LAWS
from systems.laws.parameters import VelocityTerm


class SharedRepulsion(Parameters):
    """Parameters that the pushes of all laws share."""

    velocity_term: VelocityTerm = "printed"
    """Definition of the speed s: ``printed`` is |dC/dt|, ``closing`` is the speed of
    approach only."""


if TYPE_CHECKING:

    class RepulsionParameters(SharedRepulsion):
        """Stub for type checkers, which cannot see the fields from the catalogue."""

        def __init__(self, **fields: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...

else:
    RepulsionParameters = create_model(
        "RepulsionParameters",
        __base__=SharedRepulsion,
        __module__=__name__,
        __doc__="Gains of the push off obstacles; each law reads its own set.",
        **{
            law.name: (
                law.gains,
                Field(law.gains(), description=f"Gains of ``law: {law.name}``."),
            )
            for law in LAWS.values()
            if law.gains is not None
        },
    )
