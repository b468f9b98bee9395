"""Parts of the stability report about the poles under uncertain parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from analysis.linear.loop_uncertainty import (
    contact_poles,
    contact_uncertainty,
    following_poles,
    following_uncertainty,
)
from analysis.linear.robustness import (
    PoleCloud,
    PoleFunction,
    PoleSensitivity,
    UncertainParameter,
    pole_cloud,
    pole_sensitivities,
)
from analysis.reporting.html_page import Cell, figure_html, paragraph, table
from analysis.stability.law_analysis import Part
from diagrams import Scenario

#: Number of random points in the parameter box, in a short and in a full report.
_SAMPLES = (25, 200)


@dataclass(frozen=True)
class LoopRobustness:
    """Poles of one loop over its box of uncertain parameters."""

    cloud: PoleCloud
    sensitivities: tuple[PoleSensitivity, ...]

    def to_dict(self) -> dict[str, Any]:
        """Returns everything except the poles of each sample, for the JSON document."""
        cloud = self.cloud
        return {
            "period_s": cloud.period_s,
            "parameters": cloud.parameters,
            "samples": len(cloud.values),
            "stable_share": cloud.stable_share,
            "nominal_radius": cloud.nominal_radius,
            "worst_radius": cloud.worst_radius,
            "worst_damping_ratio": cloud.worst_damping_ratio,
            "worst_values": cloud.worst_values,
            "worst_poles": cloud.worst_poles,
            "sensitivities": [
                vars(row) | {"parameter": row.parameter.name}
                for row in self.sensitivities
            ],
        }


def loop_robustness(
    scenario: Scenario,
    poles: PoleFunction,
    parameters: tuple[UncertainParameter, ...],
    *,
    samples: int,
) -> LoopRobustness:
    """Computes the poles of a sampled loop for uncertain parameters.

    Each uncertain parameter has an interval. All intervals together form a box.

    Args:
        scenario: The scenario with the control period and the seed.
        poles: Function from parameter values to the poles of the loop, z plane.
        parameters: The uncertain parameters with their intervals.
        samples: Number of random points in the box.

    Returns:
        The poles at the random points, the worst case, and the sensitivity of the
        slowest pole to each parameter.
    """
    return LoopRobustness(
        pole_cloud(
            poles,
            parameters,
            period=scenario.tick_s,
            samples=samples,
            seed=scenario.seed,
        ),
        pole_sensitivities(poles, parameters, period=scenario.tick_s),
    )


def robustness_parts(*, full: bool) -> tuple[Part, ...]:
    """Returns the two parts on robustness under uncertain parameters.

    The first part is about the operating point. The second part is about the motion in
    front of an obstacle.

    Args:
        full: Whether more random points of the parameter box are analyzed.

    Returns:
        The two parts, in the order of the report.
    """
    samples = _SAMPLES[full]
    return (
        Part(
            "robustness",
            "Robustness at the operating point",
            lambda study: loop_robustness(
                study.scenario,
                following_poles(study.need("equilibria").at),
                following_uncertainty(study.scenario),
                samples=samples,
            ),
            _render,
            fresh=True,
        ),
        Part(
            "contact_robustness",
            "Robustness before an obstacle",
            lambda study: loop_robustness(
                study.scenario,
                contact_poles(study.scenario),
                contact_uncertainty(study.scenario),
                samples=4 * samples,
            ),
            _render,
        ),
    )


def _render(data: LoopRobustness, name: str) -> list[str]:
    from analysis.linear.linear_plots import plot_pole_cloud, plot_sensitivities

    cloud = data.cloud
    rate = cloud.worst_growth_per_s
    boxes: list[list[Cell]] = [
        [
            f"{p.symbol}, `{p.name}`",
            p.low,
            p.nominal,
            p.high,
            p.unit.replace(" ", "\u00a0"),
            cloud.worst_values[p.name],
            p.reason,
        ]
        for p in cloud.parameters
    ]
    headings = ["parameter", "least", "nominal", "most", "unit", "worst case", "why"]
    nominal = cloud.nominal_damping_ratio
    shares: list[list[Cell]] = [
        [
            row.parameter.symbol,
            row.derivative,
            row.parameter.unit.replace(" ", "\u00a0"),
            row.per_interval,
        ]
        for row in sorted(data.sensitivities, key=lambda r: -abs(r.per_interval))
    ]
    return [
        paragraph(
            f"The analysis takes {len(cloud.values)} random points within the ranges "
            "below, and the worst corner of these ranges. "
            f"{100.0 * cloud.stable_share:.0f} % of the points are stable. In the "
            f"worst case the slowest mode {'decays' if rate < 0 else 'grows'} by "
            f"{abs(rate):.3g} 1/s and its damping ratio is "
            f"{cloud.worst_damping_ratio:.3f} (nominal {nominal:.3f})."
        ),
        table(headings, boxes),
        figure_html(
            plot_pole_cloud(cloud),
            f"{name}-cloud",
            "Poles within the ranges of all parameters, ln(z)/T of the sampled loop. "
            "Poles faster than 12 1/s are left out.",
        ),
        table(
            [
                "parameter",
                "d(pole)/dp (1/s per unit)",
                "unit",
                "over the interval (1/s)",
            ],
            shares,
            caption="Sensitivity of the slowest pole",
        ),
        figure_html(
            plot_sensitivities(data.sensitivities),
            f"{name}-sensitivity",
            "Change of the slowest pole over each interval, to first order. Orange "
            "marks less decay or a higher frequency.",
        ),
    ]
