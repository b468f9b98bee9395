"""Part of the stability report about the guarantees of the guard and their margins.

The guard is the block that limits the commands of any law, so that the robot stays in
free space.
"""

from __future__ import annotations

import math
from typing import Any

from analysis.report.plain_values import pick
from analysis.report.section import Content, Table, number
from analysis.stability.law_analysis import Part
from diagrams.scenario.warnings.guarantees import Assumption, Guarantees, guarantees


def _show(data: Guarantees) -> list[Content]:
    gap = 360.0 - data.seen_angle_deg
    return [
        f"The guard promises here: {data.promise}.",
        (
            f"At top speed the robot needs {number(data.needed_way_m)} m of clear "
            f"floor ahead of the axle; its sensors see {number(data.seen_way_m)} m. "
            f"They cover {number(data.seen_angle_deg)} deg of the full circle; "
            f"{number(gap)} deg are not covered."
        ),
        Table.of(
            data.assumptions,
            {
                "assumption": "name",
                "of": "text",
                "value": lambda each: _finite(each.value),
                "limit": _limit,
                "margin": lambda each: _finite(each.margin),
                "": lambda each: "holds" if each.holds else "broken",
            },
        ),
        "The page `Guard` of the documentation has theorems and their assumptions.",
    ]


def _finite(value: float) -> float | str:
    return value if math.isfinite(value) else "no limit"


def _limit(each: Assumption) -> str:
    sign = "≥" if each.at_least else "≤"
    return f"{sign} {number(each.limit)} {each.unit}".strip()


def _document(data: Guarantees) -> dict[str, Any]:
    return {
        **pick(data, "promise", "obstacle_speed_m_s", "seen_angle_deg", "seen_way_m"),
        "needed_way_m": data.needed_way_m,
        "assumptions": [
            pick(each, "name", "text", "value", "limit", "unit", "holds")
            for each in data.assumptions
        ],
    }


#: The theorem that holds for the robot, and the assumptions of this theorem.
GUARD = Part[Guarantees](
    "safety",
    "Safety of the guard",
    lambda study: guarantees(study.scenario),
    _show,
    document=_document,
)
