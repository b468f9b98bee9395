"""Parts of the stability report that take their time: maps, portraits, proofs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

from analysis.certificates.disturbance_bound_plots import plot_disturbance_bounds
from analysis.certificates.disturbance_bounds import disturbance_bounds
from analysis.certificates.sos_region import sos_region
from analysis.certificates.sos_region_plots import plot_sos_region
from analysis.nonlinear.equilibrium_map_plots import (
    plot_equilibrium_maps,
    plot_ratio_map,
)
from analysis.nonlinear.equilibrium_maps import (
    EquilibriumMap,
    gap_map,
    offset_map,
)
from analysis.nonlinear.phase_portrait import phase_portrait
from analysis.nonlinear.phase_portrait_plots import plot_phase_portrait
from analysis.nonlinear.stiffness_ratio import RatioMap, stiffness_ratio_map
from analysis.reporting.fact_tables import fact_table, row_table
from analysis.reporting.html_page import Cell, figure_html, number, paragraph, table
from analysis.reporting.plain_values import plain
from analysis.stability.law_analysis import Part, Study
from systems.framework.input_error import InputError

__all__ = ["extended_parts"]

#: Ways to sense two boxes, and one.
_GAP_SENSING = ("exact nearest", "exact sum", "cones")
_OFFSET_SENSING = ("exact nearest", "cones")


def extended_parts() -> tuple[Part, ...]:
    """What only a full report holds."""
    return (
        Part(
            "gap_maps",
            "Between two obstacles",
            lambda study: tuple(
                gap_map(study.scenario, sensing=sensing) for sensing in _GAP_SENSING
            ),
            _maps(
                "Where P comes to rest before two boxes, against the gap between them. "
                "With exact sensing: minima of the energy, of the nearest box alone or "
                "of the sum of both. With cones: the ends of simulated runs."
            ),
            fresh=True,
        ),
        Part(
            "offset_maps",
            "Beside one obstacle",
            lambda study: tuple(
                offset_map(study.scenario, sensing=sensing)
                for sensing in _OFFSET_SENSING
            ),
            _maps(
                "Where P comes to rest before one box, against how far it stands off "
                "the line to the source. To exact sensing a point, a disc or a corner "
                "is a saddle, never a trap; a flat face holds P as wide as it is."
            ),
        ),
        Part("stiffness_ratio_map", "Against k_ref/K_0", _ratio_map, _render_ratio_map),
        _part(
            "phase_portrait",
            "Phase portrait, head-on",
            lambda study: phase_portrait(study.scenario),
            plot_phase_portrait,
            "Distance to a wide face and its rate of change, with the goal behind it. "
            "Of the starts on a grid: how many collide, and how many are certified.",
        ),
        _part(
            "sos_region",
            "Region of attraction by sums of squares",
            lambda study: sos_region(study.scenario),
            plot_sos_region,
            "A polynomial model with motor lag, head-on, which the energy certificate "
            "leaves out. Found with Clarabel, cross-checked with CSDP, and proved "
            "once more in rational arithmetic.",
            document=lambda data: {"certificates": [data]},
        ),
        _part(
            "disturbance_bounds",
            "Moving source and moving obstacle",
            lambda study: disturbance_bounds(study.scenario),
            plot_disturbance_bounds,
            "How far a moving source pulls P off, and for how long a start stays "
            "certified before a moving obstacle.",
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
    if study.scenario.law != "active":
        raise InputError(
            "law", "the ratio k_ref/K_0 is one of the active law of 2019; choose active"
        )
    return stiffness_ratio_map(study.scenario)


def _render_ratio_map(data: RatioMap, name: str) -> list[str]:
    return [
        paragraph(
            "Head-on equilibria of the active law as k_ref/K_0 varies: the outer one, "
            "at which P is held up, and the inner one, where the force that vanishes "
            "at contact gives way. Where they meet, nothing holds P any more."
        ),
        figure_html(plot_ratio_map(data), name, "Equilibria against k_ref/K_0."),
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
    """A part of a paragraph, its numbers and one figure."""

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
