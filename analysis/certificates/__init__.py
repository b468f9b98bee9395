"""Starts from which no collision happens, with proofs."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.certificates.certificate_trials import try_certificate
    from analysis.certificates.diagram_trials import try_diagram
    from analysis.certificates.disturbance_bounds import (
        DisturbanceBounds,
        disturbance_bounds,
    )
    from analysis.certificates.energy_certificate import (
        EnergyCertificate,
        certify_energy,
    )
    from analysis.certificates.lag_model import lag_model
    from analysis.certificates.sos_region import SosRegion, sos_region
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "DisturbanceBounds",
    "EnergyCertificate",
    "SosRegion",
    "certify_energy",
    "disturbance_bounds",
    "lag_model",
    "sos_region",
    "try_certificate",
    "try_diagram",
]
