"""Parts of the stability report that take their time: maps, portraits, proofs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from analysis.disturbance_bounds import disturbance_bounds
from analysis.equilibrium_maps import gap_map, offset_map, stiffness_ratio_map
from analysis.fact_tables import fact_table, row_table
from analysis.html_page import paragraph
from analysis.phase_portrait import phase_portrait
from analysis.plain_values import plain
from analysis.sos_region import sos_region
from analysis.stability import Part, Study
from diagrams import Scenario

__all__ = ["extended_parts"]


def extended_parts() -> tuple[Part, ...]:
    """What only a full report holds."""
    return (
        _part(
            "gap_map",
            "Equilibria between two obstacles",
            gap_map,
            "Where P comes to rest before two obstacles, against the gap between "
            "them. A sink that is not the follow point is a jam.",
            fresh=True,
        ),
        _part(
            "offset_map",
            "Equilibria beside one obstacle",
            offset_map,
            "Where P comes to rest before one obstacle, against its distance from "
            "the line to the source. With exact nearest points one small obstacle is "
            "a saddle; with cones it can be a sink.",
        ),
        _part(
            "stiffness_map",
            "Equilibria against the law's stiffness",
            stiffness_ratio_map,
            "How equilibria come and go as the law gets stiffer.",
        ),
        _part(
            "phase_portrait",
            "Phase portrait, head-on",
            phase_portrait,
            "Distance to an obstacle and its rate of change, with the goal behind "
            "the obstacle.",
        ),
        _part(
            "sos_region",
            "Region of attraction by sums of squares",
            sos_region,
            "A polynomial model with motor lag, head-on. The proof is found with "
            "Clarabel, cross-checked with CSDP and verified once more by itself.",
        ),
        _part(
            "disturbance_bounds",
            "Moving source and moving obstacle",
            disturbance_bounds,
            "How far a moving source pulls P off, and for how long a start stays "
            "certified before a moving obstacle.",
        ),
    )


def _part(
    key: str,
    title: str,
    compute: Callable[[Scenario], Any],
    text: str,
    *,
    fresh: bool = False,
) -> Part:
    """A part of a paragraph, its numbers and one figure."""

    def run(study: Study) -> Any:
        return compute(study.scenario)

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
        ]

    return Part(key, title, run, render, fresh)
