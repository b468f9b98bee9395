"""Nonlinear parts of the stability report: velocity terms, energy, proofs, and maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure as Drawing

from analysis.certificates.certificate_plots import (
    plot_certificate_trials,
    plot_disturbance_bounds,
    plot_energy_balance,
    plot_energy_certificate,
    plot_sos_region,
)
from analysis.certificates.certificate_trials import CertificateTrials, try_certificate
from analysis.certificates.diagram_trials import DiagramTrials, try_diagram
from analysis.certificates.disturbance_bounds import (
    DisturbanceBounds,
    disturbance_bounds,
)
from analysis.certificates.energy_certificate import EnergyCertificate, certify_energy
from analysis.certificates.sos_region import SosRegion, sos_region
from analysis.nonlinear.contact_oscillation import (
    ContactOscillation,
    contact_oscillation,
)
from analysis.nonlinear.equilibrium_maps import (
    EquilibriumMap,
    gap_map,
    offset_map,
)
from analysis.nonlinear.nonlinear_plots import (
    plot_contact_oscillation,
    plot_equilibrium_maps,
    plot_phase_portrait,
    plot_ratio_map,
    plot_velocity_terms,
)
from analysis.nonlinear.phase_portrait import PhasePortrait, phase_portrait
from analysis.nonlinear.stiffness_ratio import RatioMap, stiffness_ratio_map
from analysis.nonlinear.velocity_passivity import EnergyBalance, energy_balance
from analysis.nonlinear.velocity_terms import (
    VelocityTermAnalysis,
    velocity_term_analysis,
)
from analysis.reporting.criterion import YES_OR_NO, Criterion, Reading
from analysis.reporting.fact_tables import fact_table, row_table
from analysis.reporting.plain_values import plain
from analysis.reporting.section import Cell, Column, Content, Figure, Table, number
from analysis.stability.law_analysis import Part, Study
from systems.framework.input_error import InputError


def _show_terms(data: VelocityTermAnalysis) -> list[Content]:
    facts = plain(data)
    sides = [
        {"velocity_term": term, **{k: v for k, v in side.items() if k != "poles"}}
        for term, variant in facts["variants"].items()
        for side in variant["sides"]
    ]
    return [
        (
            "The laws use s = |dC/dt| (`printed`) or the closing speed (`closing`), "
            "and both have a corner at rest. A linear model is valid on one side of "
            "the corner. Over a whole oscillation the printed term takes as much "
            "energy on the way in as it gives on the way out; the net effect is a push "
            "away from the obstacle."
        ),
        fact_table(facts, skip=["variants"]),
        row_table(sides, caption="One-sided linear models, M x'' + D x' + K x = 0"),
        Figure(
            lambda: plot_velocity_terms(data),
            "Describing functions at the equilibrium: damping by the first harmonic, "
            "and bias, over the amplitude of the speed.",
        ),
    ]


VELOCITY_TERMS = Part[VelocityTermAnalysis](
    "velocity_terms",
    "Velocity terms at rest",
    lambda study: velocity_term_analysis(study.scenario),
    _show_terms,
    fresh=True,
)


def _show_oscillation(data: ContactOscillation) -> list[Content]:
    rows: list[list[Cell]] = []
    for term, run in data.runs.items():
        cycle = data.predictions[term].limit_cycle
        amplitude, centre, frequency = cycle or (None, None, None)
        moving = len(run.amplitudes_m) > 0
        rows.append([term, "predicted", amplitude, centre, frequency, ""])
        rows.append(
            [
                term,
                "simulated",
                run.settled_amplitude_m,
                float(run.centres_m[-1]) if moving else None,
                float(run.frequencies_rad_s[-1]) if moving else None,
                run.cause,
            ]
        )
    return [
        (
            "P runs head-on against a wide box that has the goal behind it. Harmonic "
            "balance with the sampled chain from acceleration to motion predicts how "
            "an oscillation of each amplitude grows; a limit cycle is at the amplitude "
            "where growth turns to decay. Without a predicted cycle the oscillation "
            "decays at all amplitudes, or grows until the speed limit stops it."
        ),
        Table(
            [
                "velocity term",
                "",
                Column("amplitude", "m"),
                Column("center", "m"),
                "rad/s",
                "run ended",
            ],
            rows,
        ),
        Figure(
            lambda: plot_contact_oscillation(data),
            "The oscillation before an obstacle, predicted and simulated.",
        ),
    ]


CONTACT_OSCILLATION = Part[ContactOscillation](
    "contact_oscillation",
    "Oscillation before an obstacle",
    lambda study: contact_oscillation(study.scenario),
    _show_oscillation,
)

#: Number of simulated starts on each side of the border of the certified set.
STARTS = 300
#: Number of starts that are simulated in the full diagram with exact hearing.
DIAGRAM_STARTS = 24


@dataclass(frozen=True)
class CertifiedStarts:
    """The energy certificate, and simulations that check the certificate."""

    certificate: EnergyCertificate
    trials: CertificateTrials
    """Simulations in the model of the certificate."""
    diagram: DiagramTrials | None
    """Simulations in the diagram of all blocks. None in a short report."""


def _certified(study: Study) -> CertifiedStarts:
    certificate = certify_energy(study.scenario)
    starts = 10 * STARTS if study.full else STARTS
    return CertifiedStarts(
        certificate,
        try_certificate(certificate, starts=starts),
        try_diagram(certificate, starts=DIAGRAM_STARTS) if study.full else None,
    )


def _show_certificates(data: CertifiedStarts) -> list[Content]:
    return [
        (
            "In the model of the certificate (P alone, continuous time, exact nearest "
            "points, bodies at rest) the energy V cannot grow. A start never collides "
            "if its energy is below the energy of every path to contact. The full "
            "diagram has cones, a rectangular body and motor lag, which the "
            "certificate leaves out: a full report states the collision rate of the "
            "full diagram from certified starts."
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
        *(
            [
                fact_table(
                    plain(data.diagram), caption="Certified starts in the full diagram"
                )
            ]
            if data.diagram
            else []
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
            "in the certificate's model, P touches nothing from this scenario's start",
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
    fresh=True,
)  # fmt: skip


def _show_balance(data: EnergyBalance) -> list[Content]:
    return [
        (
            "The velocity term adds energy when it pushes along the motion. The loop "
            "is passive where the attraction's damping takes at least as much energy "
            "at every speed."
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
            "the velocity term never gives more energy than D_r takes",
            "the velocity term can drive the motion",
            "passivity",
            _injected_share,
        ),
    ),
)  # fmt: skip

Maps = tuple[EquilibriumMap, ...]


def _maps(text: str) -> Callable[[Maps], list[Content]]:
    def show(data: Maps) -> list[Content]:
        table = Table.of(
            data,
            {
                "sensing": "sensing",
                "values tried": lambda found: len(found.values),
                Column("jams at", "m"): lambda found: _listed(found.jams),
                Column("collisions at", "m"): lambda found: _listed(found.collisions),
            },
        )
        drawing = Figure(lambda: plot_equilibrium_maps(data), "Where P comes to rest.")
        return [text, table, drawing]

    return show


def _listed(values: tuple[float, ...]) -> str:
    return ", ".join(number(value, 3) for value in values) or "none"


GAP_MAPS = Part[Maps](
    "gap_maps",
    "Between two obstacles",
    lambda study: tuple(
        gap_map(study.scenario, sensing=sensing)
        for sensing in ("exact nearest", "exact sum", "cones")
    ),
    _maps(
        "The figures show where P comes to rest before two boxes, over the gap between "
        "the boxes. With exact sensing these places are minima of the energy, of the "
        "nearest box alone or of the sum of both boxes. With cones they are the ends "
        "of simulated runs."
    ),
    fresh=True,
    slow=True,
)

OFFSET_MAPS = Part[Maps](
    "offset_maps",
    "Before one obstacle off the line",
    lambda study: tuple(
        offset_map(study.scenario, sensing=sensing)
        for sensing in ("exact nearest", "cones")
    ),
    _maps(
        "The figures show where P comes to rest before one box, over the distance of "
        "the box from the line to the source. With exact sensing a point, a disc or a "
        "corner makes a saddle and never a trap; a flat face traps P over its whole "
        "width."
    ),
    slow=True,
)


def _ratio_map(study: Study) -> RatioMap:
    if study.scenario.only.law != "active":
        raise InputError(
            "law", "only the active law of 2019 has the ratio k_ref/K_0; choose active"
        )
    return stiffness_ratio_map(study.scenario)


RATIO_MAP = Part[RatioMap](
    "stiffness_ratio_map",
    "Equilibria over k_ref/K_0",
    _ratio_map,
    lambda data: [
        (
            "The figure shows the head-on equilibria of the active law as k_ref/K_0 "
            "varies. P stops at the outer equilibrium; at the inner one P moves on, "
            "because the force vanishes at contact. Where the two meet, no force stops "
            "P any more."
        ),
        Figure(lambda: plot_ratio_map(data), "Head-on equilibria over k_ref/K_0."),
    ],
    slow=True,
)


def _facts_and_figure(
    text: str, plot: Callable[[Any], Drawing], caption: str
) -> Callable[[Any], Sequence[Content]]:
    """Shows a paragraph, the numbers of a data object, and one figure."""

    def show(data: Any) -> list[Content]:
        facts = plain(data)
        tables = [
            row_table(value, caption=group.replace("_", " "))
            for group, value in facts.items()
            if isinstance(value, list) and value and isinstance(value[0], dict)
        ]
        return [text, fact_table(facts), *tables, Figure(lambda: plot(data), caption)]

    return show


PHASE_PORTRAIT = Part[PhasePortrait](
    "phase_portrait",
    "Phase portrait, head-on",
    lambda study: phase_portrait(study.scenario),
    _facts_and_figure(
        "The figure shows the distance to a wide face and its rate of change, with the "
        "goal behind the face. The numbers state how many starts on a grid collide and "
        "how many are certified.",
        plot_phase_portrait,
        "Phase portrait, head-on.",
    ),
    slow=True,
)

SOS_REGION = Part[SosRegion](
    "sos_region",
    "Region of attraction by sums of squares",
    lambda study: sos_region(study.scenario),
    _facts_and_figure(
        "The model is polynomial and head-on, and has the motor lag that the energy "
        "certificate leaves out. Clarabel found the region, CSDP cross-checked it, and "
        "a proof in rational arithmetic confirms it.",
        plot_sos_region,
        "Region of attraction by sums of squares.",
    ),
    slow=True,
)

DISTURBANCE_BOUNDS = Part[DisturbanceBounds](
    "disturbance_bounds",
    "Moving source and moving obstacle",
    lambda study: disturbance_bounds(study.scenario),
    _facts_and_figure(
        "The figures show how far a moving source pulls P off its place, and how long "
        "a start stays certified before a moving obstacle.",
        plot_disturbance_bounds,
        "Moving source and moving obstacle.",
    ),
    slow=True,
)
