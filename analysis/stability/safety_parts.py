"""Part of the stability report about the guarantees of the guard and their margins.

The guard is the block that limits the commands of any law, so that the robot stays in
free space.
"""

from __future__ import annotations

import math
from typing import Any

from analysis.reporting.html_page import Cell, number, paragraph, table
from analysis.stability.law_analysis import Part
from diagrams.scenario.warnings.guarantees import Guarantees, guarantees


def safety_parts() -> tuple[Part, ...]:
    """Returns the part about the guarantees of the guard.

    The part states the theorem that holds for the robot, and the assumptions of this
    theorem.
    """
    return (
        Part(
            "safety",
            "Safety of the guard",
            lambda study: guarantees(study.scenario),
            _render,
            document=_document,
        ),
    )


def _render(data: Guarantees, prefix: str) -> list[str]:
    rows: list[list[Cell]] = [
        [
            each.name,
            each.text,
            _finite(each.value),
            f"{'≥' if each.at_least else '≤'} {number(each.limit)} {each.unit}".strip(),
            _finite(each.margin),
            "holds" if each.holds else "broken",
        ]
        for each in data.assumptions
    ]
    gap = 360.0 - data.seen_angle_deg
    return [
        paragraph(f"The guard promises here: {data.promise}."),
        paragraph(
            f"At top speed the robot needs {number(data.needed_way_m)} m of clear "
            f"floor ahead of the axle; its sensors see {number(data.seen_way_m)} m. "
            f"They cover {number(data.seen_angle_deg)} deg of the full circle; "
            f"{number(gap)} deg are not covered."
        ),
        table(["assumption", "of", "value", "limit", "margin", ""], rows),
        paragraph("See docs/guard.md for theorems, assumptions and their tests."),
    ]


def _finite(value: float) -> float | str:
    return value if math.isfinite(value) else "no limit"


def _document(data: Guarantees) -> dict[str, Any]:
    return {
        "safety": {
            "promise": data.promise,
            "obstacle_speed_m_s": data.obstacle_speed_m_s,
            "seen_angle_deg": data.seen_angle_deg,
            "seen_way_m": data.seen_way_m,
            "needed_way_m": data.needed_way_m,
            "assumptions": [
                {
                    "name": each.name,
                    "text": each.text,
                    "value": each.value if math.isfinite(each.value) else None,
                    "limit": each.limit,
                    "unit": each.unit,
                    "holds": each.holds,
                }
                for each in data.assumptions
            ],
        }
    }
