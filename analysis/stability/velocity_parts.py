"""Parts of the stability report: velocity terms that have a corner at rest."""

from __future__ import annotations

from analysis.nonlinear.contact_oscillation import (
    ContactOscillation,
    contact_oscillation,
)
from analysis.nonlinear.velocity_term_plots import (
    plot_contact_oscillation,
    plot_velocity_terms,
)
from analysis.nonlinear.velocity_terms import (
    VelocityTermAnalysis,
    velocity_term_analysis,
)
from analysis.reporting.fact_tables import fact_table, row_table
from analysis.reporting.html_page import Cell, figure_html, paragraph, table
from analysis.reporting.plain_values import plain
from analysis.stability.law_analysis import Part

__all__ = ["velocity_parts"]


def velocity_parts() -> tuple[Part, ...]:
    """One-sided models and describing functions; oscillation before an obstacle."""
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
            "The laws see s = |dC/dt| (`printed`) or the closing speed (`closing`), "
            "which both have a corner at rest. A linear model holds on one side of it. "
            "Over a whole oscillation the printed term damps on the way in what it "
            "drives on the way out; what is left is a push away from the obstacle."
        ),
        fact_table(facts, skip=["variants"]),
        row_table(sides, caption="One-sided linear models, M x'' + D x' + K x = 0"),
        figure_html(
            plot_velocity_terms(data),
            name,
            "Describing functions at the equilibrium: damping by the first harmonic "
            "and bias, against the amplitude of the speed.",
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
        "centre (m)",
        "rad/s",
        "run ended",
    ]
    return [
        paragraph(
            "P runs head-on against a wide box with the goal behind it. Harmonic "
            "balance with the sampled chain from acceleration to motion predicts how "
            "an oscillation of each amplitude grows; a limit cycle is where growth "
            "turns to decay. No prediction: the oscillation decays at all amplitudes, "
            "or grows until the speed limit stops it."
        ),
        table(headings, rows),
        figure_html(
            plot_contact_oscillation(data),
            name,
            "The oscillation before an obstacle, predicted and simulated.",
        ),
    ]
