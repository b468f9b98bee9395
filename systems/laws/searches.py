"""The records of the searches, which a robot runs instead of a law."""

from __future__ import annotations

from systems.laws.law import Equation, Law

PLUME_SEARCH = Law(
    name="plume_search",
    title="Search for an odor source by smell and wind (Song 2011)",
    label="plume search",
    equations=(
        Equation(
            "Heading after a stop, upwind_gradient",
            r"\beta=\alpha+\psi_{up}+\mathrm{clip}(k\,\ln(C_1/C_3),\pm 45^\circ)",
            "beta = alpha + psi_up + clip(k ln(C1/C3), 45 deg)",
        ),
    ),
    robot="odor_searcher",
)

SOUND_SEARCH = Law(
    name="sound_search",
    title="Search for a calling robot by four microphones (Song 2011)",
    label="sound search",
    equations=(
        Equation(
            "Heading after a stop",
            r"\beta=\alpha+\theta",
            "beta = alpha + theta",
        ),
    ),
    robot="sound_searcher",
)
