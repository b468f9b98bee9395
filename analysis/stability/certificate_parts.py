"""Parts of the stability report: certified starts, energy of the velocity term."""

from __future__ import annotations

from dataclasses import dataclass

from analysis.energy.certificate_plots import (
    plot_certificate_trials,
    plot_energy_balance,
    plot_energy_certificate,
)
from analysis.energy.certificate_trials import CertificateTrials, try_certificate
from analysis.energy.energy_certificate import EnergyCertificate, certify_energy
from analysis.energy.velocity_passivity import EnergyBalance, energy_balance
from analysis.report.criterion import YES_OR_NO, Criterion, Reading
from analysis.report.fact_tables import fact_table
from analysis.report.plain_values import plain
from analysis.report.section import Content, Figure
from analysis.stability.law_analysis import Part, Study

#: Number of simulated starts inside, and of those outside the certified set. A full
#: report has ten times as many.
STARTS = 300


@dataclass(frozen=True)
class CertifiedStarts:
    """The energy certificate, and simulations that check the certificate."""

    certificate: EnergyCertificate
    trials: CertificateTrials
    """Simulations in the model of the certificate."""


def _certified(study: Study) -> CertifiedStarts:
    certificate = certify_energy(study.scenario)
    starts = 10 * STARTS if study.full else STARTS
    return CertifiedStarts(certificate, try_certificate(certificate, starts=starts))


def _show_certificates(data: CertifiedStarts) -> list[Content]:
    return [
        (
            "In the model of the certificate (P alone, continuous time, exact nearest "
            "points, bodies at rest) the energy V cannot grow. A start never collides "
            "if its energy is below the energy of every path to contact. The full "
            "diagram has cones, a rectangular body and motor lag, which the "
            "certificate leaves out."
        ),
        fact_table(plain(data.certificate), skip=["passivity", "kind"]),
        Figure(
            lambda: plot_energy_certificate(data.certificate),
            "Largest certified speed of P at each place on the floor. At white places "
            "not even rest is certified.",
            scale=True,
        ),
        fact_table(
            plain(data.trials),
            caption="Simulated starts in the model of the certificate",
        ),
        Figure(
            lambda: plot_certificate_trials(data.trials),
            "Outcomes of simulated starts, and the certified region.",
        ),
    ]


def _start_certified(data: CertifiedStarts) -> Reading:
    certified = data.certificate.start_certified
    if certified is None:
        return "bodies move, and the certificate is about bodies at rest"
    return float(certified)


CERTIFIED_STARTS = Part[CertifiedStarts](
    "certified_starts",
    "Certified starts",
    _certified,
    _show_certificates,
    criteria=(
        Criterion(
            "start certified", YES_OR_NO, "at least", 1.0,
            "in the certificate's model, P never touches a body from this start",
            "energy alone does not exclude a contact from this start",
            "energy certificate",
            _start_certified,
        ),
        Criterion(
            "collisions from certified starts", "", "at most", 0.0,
            "simulation does not contradict the certificate",
            "simulation contradicts the certificate",
            "a proof has no exceptions",
            lambda data: data.trials.inside_collisions,
        ),
    ),
    notes=lambda data: (
        ("A certificate is about the point P only: another part of the body may still "
        "touch something."),
    ),
)  # fmt: skip


def _show_balance(data: EnergyBalance) -> list[Content]:
    return [
        (
            "The velocity term adds energy when it pushes along the motion. The loop "
            "is passive if the damping of the attraction removes at least as much "
            "energy at every speed."
        ),
        fact_table(plain(data)),
        Figure(
            lambda: plot_energy_balance(data),
            "Energy during a run of the point model, and the work of each force.",
        ),
    ]


def _injected_share(data: EnergyBalance) -> Reading:
    """Largest power of the velocity term relative to the power of the damping D_r."""
    passivity = data.passivity
    if passivity.attraction_damping_n_s_m == 0.0:
        return "there is no damping to compare with"
    return passivity.largest_injection_n_s_m / passivity.attraction_damping_n_s_m


ENERGY_BALANCE = Part[EnergyBalance](
    "energy_balance",
    "Energy of the velocity term",
    lambda study: energy_balance(study.scenario),
    _show_balance,
    criteria=(
        Criterion(
            "largest power of the velocity term", "of D_r", "at most", 1.0,
            "the velocity term never adds more energy than D_r removes",
            "the velocity term can add more energy than D_r removes",
            "passivity",
            _injected_share,
        ),
    ),
)  # fmt: skip
