"""Parts of the stability report about the poles under uncertain parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from analysis.loops.drive_families import (
    drive_families,
    drive_poles,
    drive_uncertainty,
)
from analysis.loops.heading_families import (
    heading_families,
    heading_poles,
    heading_uncertainty,
)
from analysis.loops.linear_plots import plot_pole_cloud, plot_sensitivities
from analysis.loops.loop_bound import LoopBound, bound_loop
from analysis.loops.motion_families import (
    BoxFamilies,
    contact_families,
    following_families,
)
from analysis.loops.robustness import (
    PoleCloud,
    PoleFunction,
    PoleSensitivity,
    UncertainParameter,
    contact_poles,
    contact_uncertainty,
    following_poles,
    following_uncertainty,
    pole_cloud,
    pole_sensitivities,
)
from analysis.report.criterion import Bounds, Criterion, Reading
from analysis.report.plain_values import pick
from analysis.report.section import Column, Content, Figure, Table, number
from analysis.routes.route_families import (
    nominal_difference,
    route_families,
    route_poles,
    route_uncertainty,
)
from analysis.stability.law_analysis import Part, Study
from diagrams import Scenario
from systems.framework.input_error import InputError

#: Number of random points in the parameter box, in a short and in a full report. The
#: analysis of contact takes four times as many.
_SAMPLES = (25, 200)
#: Difference of growth rates that counts as rounding, 1/s.
_ROUNDING_PER_S = 1e-10


@dataclass(frozen=True)
class LoopRobustness:
    """Poles of one loop while its uncertain parameters vary within their intervals."""

    cloud: PoleCloud
    sensitivities: tuple[PoleSensitivity, ...]
    bound: LoopBound | str
    """Proven bound of the growth rate, or the reason why there is none."""

    @property
    def growth_per_s(self) -> Reading:
        """Growth rate in the worst case, 1/s, from both sides if there is a bound."""
        found = self.cloud.worst_growth_per_s
        if isinstance(self.bound, str):
            return found
        return Bounds(found, self.bound.proven_growth_per_s)


def loop_robustness(
    scenario: Scenario,
    poles: PoleFunction,
    families: BoxFamilies,
    parameters: tuple[UncertainParameter, ...],
    *,
    samples: int,
    known_error_per_s: float = 0.0,
) -> LoopRobustness:
    """Computes how the poles of a sampled loop depend on uncertain parameters.

    Each uncertain parameter has an interval. All intervals together form a box.
    ``poles`` is a function from parameter values to the poles of the loop in the z
    plane, and ``families`` from a box to the same loops. ``samples`` is the number of
    random points in the box. ``known_error_per_s`` is that of ``bound_loop``.
    """
    cloud = pole_cloud(
        poles,
        parameters,
        period=scenario.tick_s,
        samples=samples,
        seed=scenario.seed,
    )
    bound: LoopBound | str
    try:
        bound = bound_loop(families, cloud, known_error_per_s)
    except InputError as error:
        bound = str(error)
    sensitivities = pole_sensitivities(poles, parameters, period=scenario.tick_s)
    return LoopRobustness(cloud, sensitivities, bound)


def _document(data: LoopRobustness) -> dict[str, Any]:
    """Returns everything except the poles of each sample."""
    return {
        **pick(
            data.cloud, "period_s", "parameters", "stable_share", "nominal_radius",
            "worst_radius", "worst_damping_ratio", "worst_values", "worst_poles",
        ),
        "samples": len(data.cloud.values),
        "bound": {"problem": data.bound} if isinstance(data.bound, str) else data.bound,
        "sensitivities": [
            vars(row) | {"parameter": row.parameter.name} for row in data.sensitivities
        ],
    }  # fmt: skip


def bound_text(bound: LoopBound | str, found_per_s: float) -> str:
    """Describes a proven bound; ``found_per_s`` is the growth rate found, 1/s."""
    if isinstance(bound, str):
        return f"No upper bound: {bound}."
    proven = bound.proven_growth_per_s
    if math.isinf(proven):
        return "No upper bound: the proof needs too many parts of the ranges."
    gap = (proven - found_per_s) / abs(found_per_s) if found_per_s else math.inf
    scale = f"All loops are proven stable in {number(bound.scale_proven)} times the "
    if math.isinf(bound.scale_unstable):
        scale += f"ranges, and the search ends at {number(bound.scale_largest)} times."
    else:
        scale += (
            "ranges about the nominal values, and an unstable loop was found in "
            f"{number(bound.scale_unstable)} times the ranges."
        )
    reduced = ""
    if bound.model_error_per_s > _ROUNDING_PER_S:
        reduced = (
            " It is about a reduced loop. Where both were compared, the growth rates "
            f"differ by at most {number(bound.model_error_per_s, 2)} 1/s, and the "
            "bound allows for ten times this difference."
        )
    margins = ""
    if bound.disk_margin.found > 0.0:
        disk, delay = bound.disk_margin, bound.delay_margin_s
        margins = (
            " With the loop opened at the signal that its controller commands, the "
            f"disk margin is proven to be at least {number(disk.proven, 4)} (found "
            f"{number(disk.found, 4)}), and the delay margin at least "
            f"{number(delay.proven, 4)} s (found {number(delay.found, 4)} s)."
        )
    return (
        f"It is proven that no values in the ranges have a growth rate above "
        f"{number(proven, 5)} 1/s. The worst case found has {number(found_per_s, 5)} "
        f"1/s, so that the gap is {number(100.0 * gap, 2)} %. {scale} The proof is "
        f"by zero exclusion with Bernstein coefficients, with {bound.parts} parts in "
        f"{number(bound.computing_time_s, 2)} s.{reduced}{margins}"
    )


def _show(data: LoopRobustness) -> list[Content]:
    cloud = data.cloud
    rate = cloud.worst_growth_per_s
    nominal = cloud.nominal_damping_ratio
    return [
        (
            f"The analysis takes {len(cloud.values)} random points within the ranges "
            "below, and the worst corner of these ranges. "
            f"{100.0 * cloud.stable_share:.0f} % of the points are stable. In the "
            f"worst case the slowest mode {'decays' if rate < 0 else 'grows'} by "
            f"{abs(rate):.3g} 1/s and its damping ratio is "
            f"{cloud.worst_damping_ratio:.3f} (nominal {nominal:.3f})."
        ),
        bound_text(data.bound, rate),
        Table.of(
            cloud.parameters,
            {
                "parameter": lambda p: f"{p.symbol}, `{p.name}`",
                "least": "low",
                "nominal": "nominal",
                "most": "high",
                "unit": lambda p: p.unit.replace(" ", "\u00a0"),
                "worst case": lambda p: cloud.worst_values[p.name],
                "why": "reason",
            },
        ),
        Figure(
            lambda: plot_pole_cloud(cloud),
            "Poles within the ranges of all parameters, ln(z)/T of the sampled loop. "
            "Poles faster than 12 1/s are left out.",
        ),
        Table.of(
            sorted(data.sensitivities, key=lambda row: -abs(row.per_interval)),
            {
                "parameter": "parameter.symbol",
                Column("d(pole)/dp", "1/s per unit"): "derivative",
                "unit": lambda row: row.parameter.unit.replace(" ", "\u00a0"),
                Column("over the interval", "1/s"): "per_interval",
            },
            "Sensitivity of the slowest pole",
        ),
        Figure(
            lambda: plot_sensitivities(data.sensitivities),
            "Change of the slowest pole over each interval, to first order. Orange "
            "marks less decay or a higher frequency.",
        ),
    ]


def _part(
    key: str,
    title: str,
    compute: Callable[[Study], LoopRobustness],
    growth: str,
    good: str,
    bad: str,
) -> Part[LoopRobustness]:
    """Part about one loop. ``growth`` names its growth rate in the summary."""
    return Part[LoopRobustness](
        key,
        title,
        compute,
        _show,
        criteria=(
            Criterion(
                f"{growth}, worst parameters", "1/s", "below", 0.0, good, bad,
                "stability over the ranges of all parameters",
                lambda data: data.growth_per_s,
            ),
        ),
        document=_document,
    )  # fmt: skip


def _following(study: Study) -> LoopRobustness:
    at = study.need("equilibria").at
    return loop_robustness(
        study.scenario,
        following_poles(at),
        following_families(at),
        following_uncertainty(study.scenario),
        samples=_SAMPLES[study.full],
    )


ROBUSTNESS = _part(
    "robustness",
    "Robustness at the operating point",
    _following,
    "growth at rest",
    "it stays stable for all parameters in their ranges",
    "some parameters in their ranges make it unstable",
)


def _before_an_obstacle(study: Study) -> LoopRobustness:
    return loop_robustness(
        study.scenario,
        contact_poles(study.scenario),
        contact_families(study.scenario),
        contact_uncertainty(study.scenario),
        samples=4 * _SAMPLES[study.full],
    )


CONTACT_ROBUSTNESS = _part(
    "contact_robustness",
    "Robustness before an obstacle",
    _before_an_obstacle,
    "growth before an obstacle",
    "it comes to rest before an obstacle for all parameters in their ranges",
    "some parameters in their ranges make it swing where the law is stiffest",
)


def _of_families(
    study: Study,
    poles: Callable[[Scenario], PoleFunction],
    families: Callable[[Scenario], BoxFamilies],
    uncertainty: Callable[[Scenario], tuple[UncertainParameter, ...]],
    known_error_per_s: float = 0.0,
) -> LoopRobustness:
    scenario = study.scenario
    return loop_robustness(
        scenario,
        poles(scenario),
        families(scenario),
        uncertainty(scenario),
        samples=4 * _SAMPLES[study.full],
        known_error_per_s=known_error_per_s,
    )


def _on_a_route(study: Study) -> LoopRobustness:
    error = nominal_difference(study.scenario, study.need("frozen_gains"))
    return _of_families(study, route_poles, route_families, route_uncertainty, error)


ROUTE_ROBUSTNESS = _part(
    "route_robustness",
    "Robustness on the route and before a wall",
    _on_a_route,
    "growth with frozen gains",
    "small deviations die out for all parameters in their ranges",
    "small deviations grow for some parameters in their ranges",
)


def _of_the_heading(study: Study) -> LoopRobustness:
    return _of_families(study, heading_poles, heading_families, heading_uncertainty)


HEADING_ROBUSTNESS = _part(
    "heading_robustness",
    "Robustness of the heading",
    _of_the_heading,
    "growth of the heading",
    "it turns to its heading for all parameters in their ranges",
    "some parameters in their ranges make it swing about its heading",
)


def _on_free_floor(study: Study) -> LoopRobustness:
    return _of_families(study, drive_poles, drive_families, drive_uncertainty)


DRIVE_ROBUSTNESS = _part(
    "drive_robustness",
    "Robustness on free floor",
    _on_free_floor,
    "growth on free floor",
    "it follows its way for all parameters in their ranges",
    "some parameters in their ranges make it swing on free floor",
)
