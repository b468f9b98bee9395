"""The gains of all laws, one set a law.

K_0, k_ref, D_0 and d_ref are not printed in the papers. These defaults are what
``phonotaxis design`` derives from stated requirements, the same for each law;
docs/avoidance.md explains.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from systems.laws.catalogue import LAWS
from systems.laws.parameters import SharedRepulsion

if TYPE_CHECKING:

    class RepulsionParameters(SharedRepulsion):
        """The fields are the catalogue's, which no type checker can read."""

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
