"""Parts of the stability report: charts over gains, delay and sample period."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.linear.root_locus import RootLocus, root_loci
from analysis.linear.sampled_stability import (
    ConditionCheck,
    PolesAgainstPeriod,
    StabilityChart,
    check_conditions,
    gain_chart,
    gain_delay_chart,
    poles_against_period,
)
from analysis.reporting.html_page import Cell, figure_html, paragraph, table
from analysis.reporting.plain_values import plain
from analysis.stability.chart_plots import (
    plot_chart,
    plot_poles_against_period,
    plot_root_loci,
)
from analysis.stability.law_analysis import Part, Study

__all__ = ["SamplingCharts", "chart_parts"]


@dataclass(frozen=True)
class SamplingCharts:
    """How sampling, gains and delay decide, with today's design marked."""

    conditions: tuple[ConditionCheck, ...]
    """Closed forms of the sampled double integrator."""
    period: PolesAgainstPeriod
    charts: tuple[StabilityChart, ...]


def chart_parts() -> tuple[Part, ...]:
    """Root loci, poles against the sample period, stability charts."""
    return (
        Part(
            "root_loci",
            "Root loci",
            lambda study: root_loci(study.scenario),
            _render_loci,
        ),
        Part(
            "sampling",
            "Sample period, gains and delay",
            _sampling,
            _render_sampling,
            document=lambda data: {
                "sampling": {
                    "conditions": data.conditions,
                    "longest_stable_period_s": data.period.longest_stable_s,
                    "charts": [
                        {"title": c.title, "stable_share": c.stable_share}
                        | {k: v for k, v in plain(c).items() if k != "title"}
                        for c in data.charts
                    ],
                }
            },
        ),
    )


def _sampling(study: Study) -> SamplingCharts:
    scenario = study.scenario
    return SamplingCharts(
        check_conditions(seed=scenario.seed, tick_s=scenario.tick_s),
        poles_against_period(scenario),
        (gain_chart(scenario), gain_delay_chart(scenario)),
    )


def _render_loci(data: Sequence[RootLocus], name: str) -> list[str]:
    rows: list[list[Cell]] = [
        [f"`{locus.parameter}`", locus.loop, locus.today, locus.limit] for locus in data
    ]
    return [
        paragraph(
            "Poles as one gain varies, ln(z)/T of the sampled loop: of the loop to the "
            "target, and of the contact mode where the law is stiffest."
        ),
        table(["gain", "loop", "today", "stability ends at"], rows),
        figure_html(plot_root_loci(data), name, "Root loci; today's poles are marked."),
    ]


def _render_sampling(data: SamplingCharts, name: str) -> list[str]:
    conditions: list[list[Cell]] = [
        [c.scheme, c.condition, c.pairs, c.stable, c.mismatches]
        for c in data.conditions
    ]
    return [
        table(
            ["scheme", "stable exactly for", "pairs tried", "stable", "mismatches"],
            conditions,
            caption="Sampled double integrator: closed form against eigenvalues",
        ),
        paragraph(
            f"The loop to the target stays stable up to a sample period of "
            f"{data.period.longest_stable_s:.3g} s; today {data.period.today_s:g} s."
        ),
        figure_html(
            plot_poles_against_period(data.period),
            f"{name}-period",
            "Poles against the sample period.",
        ),
        *(
            figure_html(
                plot_chart(chart), f"{name}-chart{k}", f"Growth: {chart.title}."
            )
            for k, chart in enumerate(data.charts)
        ),
    ]
