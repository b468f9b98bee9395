"""What they do not: velocity terms, oscillations, equilibria, portraits."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.nonlinear.contact_oscillation import contact_oscillation
    from analysis.nonlinear.equilibrium_maps import gap_map, offset_map
    from analysis.nonlinear.harmonic_balance import predict_oscillation
    from analysis.nonlinear.phase_portrait import phase_portrait
    from analysis.nonlinear.stiffness_ratio import stiffness_ratio_map
    from analysis.nonlinear.trap_stiffness import trap_stiffness
    from analysis.nonlinear.velocity_passivity import (
        energy_balance,
        velocity_term_passivity,
    )
    from analysis.nonlinear.velocity_terms import velocity_term_analysis
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "contact_oscillation",
    "energy_balance",
    "gap_map",
    "offset_map",
    "phase_portrait",
    "predict_oscillation",
    "stiffness_ratio_map",
    "trap_stiffness",
    "velocity_term_analysis",
    "velocity_term_passivity",
]
