"""Nonlinear parts of the stability report: velocity terms, energy, proofs, and maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from analysis.certificates.certificate_plots import (
    plot_certificate_trials,
    plot_disturbance_bounds,
    plot_energy_balance,
    plot_energy_certificate,
    plot_sos_region,
)
from analysis.certificates.certificate_trials import CertificateTrials, try_certificate
from analysis.certificates.diagram_trials import DiagramTrials, try_diagram
from analysis.certificates.disturbance_bounds import disturbance_bounds
from analysis.certificates.energy_certificate import EnergyCertificate, certify_energy
from analysis.certificates.sos_region import sos_region
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
from analysis.nonlinear.phase_portrait import phase_portrait
from analysis.nonlinear.stiffness_ratio import RatioMap, stiffness_ratio_map
from analysis.nonlinear.velocity_passivity import EnergyBalance, energy_balance
from analysis.nonlinear.velocity_terms import (
    VelocityTermAnalysis,
    velocity_term_analysis,
)
from analysis.reporting.fact_tables import fact_table, row_table
from analysis.reporting.html_page import Cell, figure_html, number, paragraph, table
from analysis.reporting.plain_values import plain
from analysis.stability.law_analysis import Part, Study
from systems.framework.input_error import InputError


def nonlinear_parts(*, full: bool) -> tuple[Part, ...]:
    """Returns the nonlinear parts that every report has.

    The parts are about these subjects:

    - The velocity terms of the law.
    - The oscillation in front of an obstacle.
    - Starts from which the robot provably does not collide.
    - The energy of the velocity term.

    Args:
        full: Whether the report is a full report. A full report simulates ten times as
            many starts, and it also simulates the full diagram.

    Returns:
        Four parts, in the order of the report.
    """
    return (
        Part(
            "velocity_terms",
            "Velocity terms at rest",
            lambda study: velocity_term_analysis(study.scenario),
            _render_terms,
            fresh=True,
        ),
        Part(
            "contact_oscillation",
            "Oscillation before an obstacle",
            lambda study: contact_oscillation(study.scenario),
            _render_oscillation,
        ),
        Part(
            "certificates",
            "Certified starts",
            lambda study: (_certified(study, full=full),),
            _render_certificates,
            notes=lambda _: (_ABOUT_P,),
            fresh=True,
        ),
        Part(
            "energy_balance",
            "Energy of the velocity term",
            lambda study: energy_balance(study.scenario),
            _render_balance,
        ),
    )


def _render_terms(data: VelocityTermAnalysis, name: str) -> list[str]:
    facts = plain(data)
    sides = [
        {"velocity_term": term, **{k: v for k, v in side.items() if k != "poles"}}
        for term, variant in facts["variants"].items()
        for side in variant["sides"]
    ]
    return [
        paragraph(
            "The laws use s = |dC/dt| (`printed`) or the closing speed (`closing`), "
            "and both have a corner at rest. A linear model is valid on one side of "
            "the corner. Over a whole oscillation the printed term takes as much "
            "energy on the way in as it gives on the way out; the net effect is a "
            "push away from the obstacle."
        ),
        fact_table(facts, skip=["variants"]),
        row_table(sides, caption="One-sided linear models, M x'' + D x' + K x = 0"),
        figure_html(
            plot_velocity_terms(data),
            name,
            "Describing functions at the equilibrium: damping by the first harmonic, "
            "and bias, over the amplitude of the speed.",
        ),
    ]


def _render_oscillation(data: ContactOscillation, name: str) -> list[str]:
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
    headings = [
        "velocity term",
        "",
        "amplitude (m)",
        "center (m)",
        "rad/s",
        "run ended",
    ]
    return [
        paragraph(
            "P runs head-on against a wide box that has the goal behind it. Harmonic "
            "balance with the sampled chain from acceleration to motion predicts how "
            "an oscillation of each amplitude grows; a limit cycle is at the "
            "amplitude where growth turns to decay. Without a predicted cycle the "
            "oscillation decays at all amplitudes, or grows until the speed limit "
            "stops it."
        ),
        table(headings, rows),
        figure_html(
            plot_contact_oscillation(data),
            name,
            "The oscillation before an obstacle, predicted and simulated.",
        ),
    ]


#: Note for the first page of the report.
_ABOUT_P = (
    "A certificate is about the point P only: another part of the body may still "
    "touch something."
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

    def to_dict(self) -> dict[str, Any]:
        """Returns the entry for the list ``certificates`` of the JSON document."""
        parts = {"trials": self.trials, "diagram": self.diagram}
        return self.certificate.to_dict() | parts


def _certified(study: Study, *, full: bool) -> CertifiedStarts:
    certificate = certify_energy(study.scenario)
    return CertifiedStarts(
        certificate,
        try_certificate(certificate, starts=10 * STARTS if full else STARTS),
        try_diagram(certificate, starts=DIAGRAM_STARTS) if full else None,
    )


def _render_certificates(data: tuple[CertifiedStarts, ...], name: str) -> list[str]:
    (found,) = data
    facts = plain(found)
    return [
        paragraph(
            "In the model of the certificate (P alone, continuous time, exact nearest "
            "points, bodies at rest) the energy V cannot grow. A start never collides "
            "if its energy is below the energy of every path to contact. The full "
            "diagram has cones, a rectangular body and motor lag, which the "
            "certificate leaves out: a full report states the collision rate of the "
            "full diagram from certified starts."
        ),
        fact_table(facts, skip=["passivity", "trials", "diagram", "kind"]),
        figure_html(
            plot_energy_certificate(found.certificate),
            f"{name}-map",
            "Largest certified speed of P at each place on the floor. At white places "
            "not even rest is certified.",
            scale=True,
        ),
        fact_table(
            facts["trials"], caption="Simulated starts in the model of the certificate"
        ),
        figure_html(
            plot_certificate_trials(found.trials),
            f"{name}-trials",
            "Outcomes of simulated starts, and the certified region.",
        ),
        fact_table(facts["diagram"], caption="Certified starts in the full diagram")
        if found.diagram
        else "",
    ]


def _render_balance(data: EnergyBalance, name: str) -> list[str]:
    return [
        paragraph(
            "The velocity term adds energy when it pushes along the motion. The loop "
            "is passive where the attraction's damping takes at least as much energy "
            "at every speed."
        ),
        fact_table(plain(data)),
        figure_html(
            plot_energy_balance(data),
            name,
            "Energy during a run of the point model, and the work of each force.",
        ),
    ]


#: Ways in which the robot senses two boxes.
_GAP_SENSING = ("exact nearest", "exact sum", "cones")
#: Ways in which the robot senses one box.
_OFFSET_SENSING = ("exact nearest", "cones")


def extended_parts() -> tuple[Part, ...]:
    """Returns the parts that only a full report has."""
    return (
        Part(
            "gap_maps",
            "Between two obstacles",
            lambda study: tuple(
                gap_map(study.scenario, sensing=sensing) for sensing in _GAP_SENSING
            ),
            _maps(
                "The figures show where P comes to rest before two boxes, over the "
                "gap between the boxes. With exact sensing these places are minima of "
                "the energy, of the nearest box alone or of the sum of both boxes. "
                "With cones they are the ends of simulated runs."
            ),
            fresh=True,
        ),
        Part(
            "offset_maps",
            "Before one obstacle off the line",
            lambda study: tuple(
                offset_map(study.scenario, sensing=sensing)
                for sensing in _OFFSET_SENSING
            ),
            _maps(
                "The figures show where P comes to rest before one box, over the "
                "distance of the box from the line to the source. With exact sensing "
                "a point, a disc or a corner makes a saddle and never a trap; a flat "
                "face traps P over its whole width."
            ),
        ),
        Part(
            "stiffness_ratio_map",
            "Equilibria over k_ref/K_0",
            _ratio_map,
            _render_ratio_map,
        ),
        _part(
            "phase_portrait",
            "Phase portrait, head-on",
            lambda study: phase_portrait(study.scenario),
            plot_phase_portrait,
            "The figure shows the distance to a wide face and its rate of change, "
            "with the goal behind the face. The numbers state how many starts on a "
            "grid collide and how many are certified.",
        ),
        _part(
            "sos_region",
            "Region of attraction by sums of squares",
            lambda study: sos_region(study.scenario),
            plot_sos_region,
            "The model is polynomial and head-on, and has the motor lag that the "
            "energy certificate leaves out. Clarabel found the region, CSDP "
            "cross-checked it, and a proof in rational arithmetic confirms it.",
            document=lambda data: {"certificates": [data]},
        ),
        _part(
            "disturbance_bounds",
            "Moving source and moving obstacle",
            lambda study: disturbance_bounds(study.scenario),
            plot_disturbance_bounds,
            "The figures show how far a moving source pulls P off its place, and how "
            "long a start stays certified before a moving obstacle.",
        ),
    )


def _maps(text: str) -> Callable[[tuple[EquilibriumMap, ...], str], list[str]]:
    def render(data: tuple[EquilibriumMap, ...], name: str) -> list[str]:
        rows: list[list[Cell]] = [
            [found.sensing, len(found.values), _listed(found.jams),
             _listed(found.collisions)]
            for found in data
        ]  # fmt: skip
        headings = ["sensing", "values tried", "jams at (m)", "collisions at (m)"]
        return [
            paragraph(text),
            table(headings, rows),
            figure_html(plot_equilibrium_maps(data), name, "Where P comes to rest."),
        ]

    return render


def _listed(values: tuple[float, ...]) -> str:
    return ", ".join(number(value, 3) for value in values) or "none"


def _ratio_map(study: Study) -> RatioMap:
    if study.scenario.only.law != "active":
        raise InputError(
            "law", "only the active law of 2019 has the ratio k_ref/K_0; choose active"
        )
    return stiffness_ratio_map(study.scenario)


def _render_ratio_map(data: RatioMap, name: str) -> list[str]:
    return [
        paragraph(
            "The figure shows the head-on equilibria of the active law as "
            "k_ref/K_0 varies. P stops at the outer equilibrium; at the inner "
            "one P moves on, because the force vanishes at contact. Where the "
            "two meet, no force stops P any more."
        ),
        figure_html(plot_ratio_map(data), name, "Head-on equilibria over k_ref/K_0."),
    ]


def _part(
    key: str,
    title: str,
    compute: Callable[[Study], Any],
    plot: Callable[[Any], Figure],
    text: str,
    *,
    document: Callable[[Any], dict[str, Any]] | None = None,
) -> Part:
    """Makes a part that shows a paragraph, the numbers of its data, and one figure."""

    def render(data: Any, name: str) -> list[str]:
        facts = plain(data)
        tables = [
            row_table(value, caption=group.replace("_", " "))
            for group, value in facts.items()
            if isinstance(value, list) and value and isinstance(value[0], dict)
        ]
        return [
            paragraph(text),
            fact_table(facts),
            *tables,
            figure_html(plot(data), name, f"{title}."),
        ]

    return Part(key, title, compute, render, document=document)
