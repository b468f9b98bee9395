"""Simulated runs that show whether a law gets stuck in front of two obstacles.

The scenario is the experiment with two obstacles in the papers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from diagrams import load_scenario, simulate
from diagrams.scenario.scenario import Scenario

#: Lateral offsets of the start, m. At both ends, the robot starts in front of an
#: obstacle.
JAM_STARTS_M = tuple(np.linspace(-0.6, 0.6, 9).round(3).tolist())


@dataclass(frozen=True)
class JamRuns:
    """The outcomes of the runs of one law."""

    law: str
    causes: dict[str, int]
    """Number of runs by outcome, ``RunResult.cause``."""
    jams: int
    """Number of runs that got stuck or timed out and never reached the goal."""


def jam_runs(
    scenario: Scenario,
    laws: Sequence[str],
    *,
    progress: Callable[[float], None] | None = None,
) -> list[JamRuns]:
    """Simulates ``two_static_obstacles`` for each law and each of ``JAM_STARTS_M``.

    The runs have exact hearing and ultrasonic cones. Besides the gains, they use the
    tick, the engine, and the sample periods of the sensors of ``scenario``.
    ``progress`` is called with the number of finished runs.
    """
    settings = (
        f"tick_s={scenario.tick_s}",
        f"microphones.frame_s={scenario.follower.microphones.frame_s}",
        f"ultrasonic.period_s={scenario.follower.ultrasonic.period_s}",
        f"engine={scenario.engine}",
    )
    layout = load_scenario("two_static_obstacles", ["hearing=ideal", *settings])
    limit, gains = layout.follower.laws.active.speed_limit_m_s, scenario.follower.laws
    active = gains.active.model_copy(update={"speed_limit_m_s": limit})
    gains = gains.model_copy(update={"active": active})
    done, found = 0, []
    goal = layout.with_robot(attraction=scenario.follower.attraction).goal_radius_m
    for law in laws:
        causes: Counter[str] = Counter()
        jams = 0
        for start in JAM_STARTS_M:
            place = layout.only.start.model_copy(update={"position_m": (0.0, start)})
            run = simulate(
                layout.with_robot(
                    law=law,
                    start=place,
                    attraction=scenario.follower.attraction,
                    laws=gains,
                )
            )
            causes[run.cause] += 1
            came = bool(np.any(run.columns["source_range_true"] <= goal))
            jams += run.cause in ("stuck", "timeout") and not came
            done += 1
            if progress is not None:
                progress(done)
        found.append(JamRuns(law, dict(causes), jams))
    return found
