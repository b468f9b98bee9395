"""Computes the result of ``phonotaxis design``.

The result has gains of the laws for two attractions: for the scenario's current
attraction, and for the recommended attraction. The attraction is the virtual spring and
damper that pull the robot to the follow point.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.loops.contact_mode import largest_contact_stiffness
from analysis.loops.push_and_pull import (
    DESIGNED_LAWS,
    barrier_from_reach_n_m,
    kinetic_energy,
)
from analysis.stability.attraction_search import (
    GainFigures,
    RecommendedGains,
    braking_overshoot,
    fitting_gains,
    follow_distance,
    gain_figures,
    recommend_gains,
)
from analysis.stability.gain_search import gain_for_barrier, search_gains
from analysis.stability.requirements import (
    LawDesign,
    Requirements,
    allowed_stiffness,
    check_law,
    meters_to_go,
)
from diagrams import load_scenario, simulate
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: Values of y at the start in the scenario ``two_static_obstacles``, m. For the first
#: and the last value, an obstacle is straight ahead of the robot's body.
JAM_STARTS_M = tuple(np.linspace(-0.6, 0.6, 9).round(3).tolist())
#: Distances from the obstacle to the follow point behind it, for ``BarrierRow``, m.
_TO_GO_M = (1.0, 1.5, 2.0, 3.0)


@dataclass(frozen=True)
class JamRuns:
    """The outcomes of the runs of one law in the scenario ``two_static_obstacles``."""

    law: str
    causes: dict[str, int]
    """Number of runs by outcome."""
    jams: int
    """Number of runs that got stuck or timed out and never reached the goal."""


@dataclass(frozen=True)
class Alternative:
    """An attraction with its performance figures and with the gains of the laws."""

    scenario: Scenario
    figures: GainFigures
    overshoot_m: float
    """Overshoot past the follow point after an approach at top speed, m."""
    follow_distance_m: float
    """Least follow distance that leaves room for the overshoot, m."""
    meters_to_go: float
    """Distance from an obstacle to the follow point behind it, m."""
    allowed_stiffness_n_m: float
    """Largest stiffness of a law with which the motion in front of an obstacle is
    stable although echoes are late, N/m."""
    laws: tuple[LawDesign, ...]
    jams: tuple[JamRuns, ...]
    """Simulated runs past two obstacles to the goal, one entry per law."""

    def to_dict(self) -> dict[str, Any]:
        """Returns the figures and the attraction for the JSON document."""
        figures = {k: v for k, v in vars(self).items() if k != "scenario"}
        return {"attraction": self.scenario.follower.attraction, **figures}


@dataclass(frozen=True)
class BarrierRow:
    """Stiffness K_0 with which the conventional law just stops P before an obstacle.

    The follow point is behind the obstacle, so the attraction pulls P toward it.
    """

    meters_to_go: float
    """Distance from the obstacle to the follow point behind it, m."""
    stiffness_n_m: float
    """K_0 if P never exceeds its top speed, N/m."""
    stiffness_from_reach_n_m: float
    """K_0 if P may exceed its top speed within the reach rho_0 of the law, N/m."""


@dataclass(frozen=True)
class DesignStudy:
    """The result of ``phonotaxis design``."""

    gains: RecommendedGains
    """The recommendation, as in the stability report."""
    kinetic_energy_j: float
    """Kinetic energy of the virtual mass at top speed, J."""
    barriers: tuple[BarrierRow, ...]
    contact_limits_n_m: tuple[float, ...]
    """Largest stiffness of a law with which the motion in front of an obstacle is
    stable if echoes are 0, 1, 2, and 4 ticks late, N/m."""
    today: Alternative
    """The current attraction, with new gains of the laws. The requirements on these
    gains let the push away from the leader shift P at rest to the edge of the goal."""
    recommended: Alternative
    """The recommended attraction, with gains of all laws for this attraction."""


#: Latencies of the echoes for ``DesignStudy.contact_limits_n_m``, in control periods.
_TICKS = (0, 1, 2, 4)
#: Number of simulated runs in a complete study.
STUDY_RUNS = 2 * len(DESIGNED_LAWS) * len(JAM_STARTS_M)


def study_design(
    scenario: Scenario,
    requirements: Requirements | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> DesignStudy:
    """Chooses gains of the laws for two attractions: the current and a recommended one.

    The recommended attraction is that of the stability report. For the current
    attraction, all laws get new gains. For the recommended attraction, a law keeps its
    gains if they meet the requirements. The other parameters of the laws, such as
    reaches and speed limits, stay. ``progress`` is called with the number of finished
    runs; the study has ``STUDY_RUNS`` runs. Raises InputError if there are several
    robots, or if no gains meet a requirement that must be met.
    """
    scenario.require_one_robot("a design of gains")
    requirements = requirements or Requirements()
    within_goal = requirements.within_goal(scenario)
    laws = search_gains(scenario, within_goal)
    designed = scenario.with_robot(laws=laws)
    gains = recommend_gains(scenario, requirements)
    if gains.chosen is None:
        raise InputError("attraction", f"cannot be designed. {gains.advice}")
    laws = fitting_gains(gains.chosen, requirements, *DESIGNED_LAWS)
    better = gains.chosen.with_robot(laws=laws)
    K_r = scenario.follower.attraction.stiffness_n_m

    def later(done: float) -> None:
        if progress is not None:
            progress(done + STUDY_RUNS // 2)

    return DesignStudy(
        gains=gains,
        kinetic_energy_j=kinetic_energy(scenario),
        barriers=tuple(_barrier_row(scenario, to_go) for to_go in _TO_GO_M),
        contact_limits_n_m=tuple(
            largest_contact_stiffness(scenario, latency_ticks=ticks) - K_r
            for ticks in _TICKS
        ),
        today=_alternative(designed, within_goal, progress),
        recommended=_alternative(better, requirements, later),
    )


def _alternative(
    scenario: Scenario,
    requirements: Requirements,
    progress: Callable[[float], None] | None,
) -> Alternative:
    overshoot = braking_overshoot(scenario)
    return Alternative(
        scenario=scenario,
        figures=gain_figures(scenario, requirements),
        overshoot_m=overshoot,
        follow_distance_m=follow_distance(scenario, requirements, overshoot),
        meters_to_go=meters_to_go(scenario, requirements),
        allowed_stiffness_n_m=allowed_stiffness(scenario, requirements),
        laws=tuple(check_law(scenario, law, requirements) for law in DESIGNED_LAWS),
        jams=tuple(jam_runs(scenario, tuple(DESIGNED_LAWS), progress=progress)),
    )


def _barrier_row(scenario: Scenario, to_go: float) -> BarrierRow:
    follow = scenario.follower.attraction.follow_distance_m
    reach = scenario.follower.laws.conventional.reach_m
    farther = Requirements(source_range_m=to_go + follow + reach)
    needed = gain_for_barrier(scenario, "conventional", "stiffness_n_m", farther)
    return BarrierRow(to_go, needed, barrier_from_reach_n_m(scenario, to_go))


def jam_runs(
    scenario: Scenario,
    laws: Sequence[str],
    *,
    progress: Callable[[float], None] | None = None,
) -> list[JamRuns]:
    """Simulates ``two_static_obstacles`` for each law and each of ``JAM_STARTS_M``.

    The runs have exact hearing and ultrasonic cones. They take the attraction, the
    parameters of the laws, the control period, the engine, the length of a frame of
    audio, and the period of the ultrasonic sensors from ``scenario``. The speed limit
    of the active law is that of ``two_static_obstacles``. ``progress`` is called with
    the number of finished runs.
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
