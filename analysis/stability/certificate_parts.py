"""Parts of the stability report: what is proved, and by how much it is true."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from analysis.certificates.certificate_trials import CertificateTrials, try_certificate
from analysis.certificates.diagram_trials import DiagramTrials, try_diagram
from analysis.certificates.energy_certificate import EnergyCertificate, certify_energy
from analysis.certificates.energy_certificate_plots import (
    plot_certificate_trials,
    plot_energy_balance,
    plot_energy_certificate,
)
from analysis.nonlinear.velocity_passivity import EnergyBalance, energy_balance
from analysis.reporting.fact_tables import fact_table
from analysis.reporting.html_page import figure_html, paragraph
from analysis.stability.law_analysis import Part, Study

__all__ = ["certificate_parts"]

#: Simulated starts on each side of the certificate's border.
STARTS = 300
#: Starts of the full diagram, with exact hearing.
DIAGRAM_STARTS = 24


@dataclass(frozen=True)
class CertifiedStarts:
    """The energy certificate, and what simulation says to it."""

    certificate: EnergyCertificate
    trials: CertificateTrials
    """In the certificate's own model."""
    diagram: DiagramTrials | None
    """In the diagram of all blocks; none: left out of a short report."""

    def to_dict(self) -> dict[str, Any]:
        """An entry of ``certificates``."""
        return {
            **self.certificate.to_dict(),
            "trials": self.trials.to_dict(),
            "diagram": self.diagram and self.diagram.to_dict(),
        }


def certificate_parts(*, full: bool) -> tuple[Part, ...]:
    """The energy certificate and the energy balance of the velocity term."""
    return (
        Part(
            "certificates",
            "Certified starts",
            lambda study: (_certified(study, full=full),),
            _render_certificates,
            fresh=True,
        ),
        Part(
            "energy_balance", "Energy of the velocity term", _balance, _render_balance
        ),
    )


def _certified(study: Study, *, full: bool) -> CertifiedStarts:
    certificate = certify_energy(study.scenario)
    return CertifiedStarts(
        certificate,
        try_certificate(certificate, starts=10 * STARTS if full else STARTS),
        try_diagram(certificate, starts=DIAGRAM_STARTS) if full else None,
    )


def _render_certificates(data: tuple[CertifiedStarts, ...], name: str) -> list[str]:
    (found,) = data
    facts = found.to_dict()
    return [
        paragraph(
            "In the model of the certificate (P alone, continuous time, exact nearest "
            "points, bodies at rest) the energy V cannot grow. A start whose energy is "
            "below that of every path to contact never collides. The full diagram has "
            "cones, a rectangular body and motor lag, which the certificate leaves "
            "out: a full report has its collision rate from certified starts."
        ),
        fact_table(facts, skip=["passivity", "trials", "diagram", "kind"]),
        figure_html(
            plot_energy_certificate(found.certificate),
            f"{name}-map",
            "Largest certified speed of P over the floor. White: not even rest is "
            "certified.",
        ),
        fact_table(facts["trials"], caption="Simulated starts, certificate's model"),
        figure_html(
            plot_certificate_trials(found.trials),
            f"{name}-trials",
            "Simulated starts by outcome, over the certified region.",
        ),
        *(
            [
                fact_table(
                    facts["diagram"], caption="Certified starts in the full diagram"
                )
            ]
            if found.diagram
            else []
        ),
    ]


def _balance(study: Study) -> EnergyBalance:
    return energy_balance(study.scenario)


def _render_balance(data: EnergyBalance, name: str) -> list[str]:
    return [
        paragraph(
            "The velocity term gives energy when it pushes along the motion. It is "
            "covered where the attraction's damping takes at least as much at every "
            "speed."
        ),
        fact_table(data.to_dict()),
        figure_html(
            plot_energy_balance(data),
            name,
            "Energy along a run of the point model, and the work of its parts.",
        ),
    ]
