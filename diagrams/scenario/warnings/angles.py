"""Warnings about angles that look like radians in fields with degrees."""

from __future__ import annotations

import math
from collections.abc import Iterator

from diagrams.scenario.scenario import Scenario
from diagrams.scenario.shorthand import field_in
from diagrams.scenario.warnings.scenario_warning import ScenarioWarning

#: Angles that people write in radians are multiples of this angle, rad.
_PART_RAD = math.pi / 4.0
#: Greatest rounding error of such an angle. 3.142 is pi, and 3.14 may be meant.
_ROUNDING = 5e-4


def angle_warnings(scenario: Scenario) -> Iterator[ScenarioWarning]:
    """Yields a warning for each heading in degrees that is a multiple of pi/4."""
    angles = {
        field_in("robots", name, "start.heading_deg"): robot.start.heading_deg
        for name, robot in scenario.robots.items()
    }
    angles |= {
        field_in("sources", name, "heading_deg"): source.heading_deg
        for name, source in scenario.sources.items()
    }
    angles |= {
        f"obstacles.{k}.heading_deg": obstacle.heading_deg
        for k, obstacle in enumerate(scenario.obstacles)
    }
    for field, angle in angles.items():
        parts = round(angle / _PART_RAD)
        if 0 < abs(parts) <= 8 and abs(angle - parts * _PART_RAD) < _ROUNDING:
            yield ScenarioWarning(
                field,
                f"is {angle:g} degrees; if radians are meant, write {45 * parts}",
            )
