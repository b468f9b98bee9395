"""The whole design: gains for the attraction as it is, and the one recommended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from analysis.design.attraction_search import (
    attraction_damping_ratio,
    braking_overshoot,
    follow_distance,
    following_lag,
    search_attraction,
)
from analysis.design.gain_search import gain_for_barrier, search_gains
from analysis.design.jam_runs import JAM_STARTS_M, JamRuns, jam_runs
from analysis.design.requirements import (
    DesignRequirements,
    LawDesign,
    allowed_stiffness,
    check_law,
    metres_to_go,
)
from analysis.laws.push_and_pull import (
    DESIGNED_LAWS,
    barrier_from_reach_n_m,
    kinetic_energy,
)
from analysis.linear.contact_mode import largest_contact_stiffness
from diagrams.scenario.scenario import Scenario

#: Distances from obstacle to rest for the table of barriers, m.
_TO_GO_M = (1.0, 1.5, 2.0, 3.0)


@dataclass(frozen=True)
class Alternative:
    """An attraction, and the gains of the laws that go with it."""

    scenario: Scenario
    """With these gains."""
    damping_ratio: float
    """Of the loop to the follow point."""
    following_lag_m: float
    """Behind the follow point of a moving source, m."""
    overshoot_m: float
    """Past the follow point of a resting source, coming at top speed, m."""
    follow_distance_m: float
    """Least follow distance with room for that, m."""
    metres_to_go: float
    """From an obstacle within reach to where the attraction rests, m."""
    allowed_stiffness_n_m: float
    """Stiffest push that is stable in contact, with spare latency, N/m."""
    laws: tuple[LawDesign, ...]
    jams: tuple[JamRuns, ...]
    """Runs before the two obstacles."""

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        figures = {k: v for k, v in vars(self).items() if k != "scenario"}
        return {"attraction": self.scenario.follower.attraction, **figures}


@dataclass(frozen=True)
class BarrierRow:
    """K_0 of the conventional law for a target so far behind the obstacle."""

    metres_to_go: float
    stiffness_n_m: float
    """With speed limited all the way, N/m."""
    stiffness_from_reach_n_m: float
    """Without that limit within rho_0, N/m."""


@dataclass(frozen=True)
class DesignStudy:
    """What ``phonotaxis design`` finds."""

    requirements: DesignRequirements
    kinetic_energy_j: float
    """At top speed, J."""
    barriers: tuple[BarrierRow, ...]
    contact_limits_n_m: tuple[float, ...]
    """Stiffest push at 0, 1, 2 and 4 periods of latency, N/m."""
    today: Alternative
    """The scenario's attraction."""
    recommended: Alternative
    """The attraction that the requirements give."""


#: Latencies of ``DesignStudy.contact_limits_n_m``, periods.
_TICKS = (0, 1, 2, 4)
#: Runs of a whole study, for progress.
STUDY_RUNS = 2 * len(DESIGNED_LAWS) * len(JAM_STARTS_M)


def study_design(
    scenario: Scenario,
    requirements: DesignRequirements | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> DesignStudy:
    """Chooses gains for a scenario's attraction and robot, and recommends others.

    Args:
        scenario: Its gains give reaches and limits of speed only.
        requirements: Bounds.
        progress: Called with the number of simulated runs, of ``STUDY_RUNS``.

    Returns:
        Gains for today's attraction and for the recommended one, and what they achieve.

    Raises:
        InputError: There are several robots, or nothing meets a requirement that has
            to be met.
    """
    scenario.require_one_robot("a design of gains")
    requirements = requirements or DesignRequirements()
    laws = search_gains(scenario, requirements)
    designed = scenario.with_robot(laws=laws)
    better = search_attraction(scenario, requirements)
    K_r = scenario.follower.attraction.stiffness_n_m

    def later(done: float) -> None:
        if progress is not None:
            progress(done + STUDY_RUNS // 2)

    return DesignStudy(
        requirements=requirements,
        kinetic_energy_j=kinetic_energy(scenario),
        barriers=tuple(_barrier_row(scenario, to_go) for to_go in _TO_GO_M),
        contact_limits_n_m=tuple(
            largest_contact_stiffness(scenario, latency_ticks=ticks) - K_r
            for ticks in _TICKS
        ),
        today=_alternative(designed, requirements, progress),
        recommended=_alternative(better, requirements, later),
    )


def _alternative(
    scenario: Scenario,
    requirements: DesignRequirements,
    progress: Callable[[float], None] | None,
) -> Alternative:
    overshoot = braking_overshoot(scenario)
    return Alternative(
        scenario=scenario,
        damping_ratio=attraction_damping_ratio(scenario),
        following_lag_m=following_lag(scenario),
        overshoot_m=overshoot,
        follow_distance_m=follow_distance(scenario, requirements, overshoot),
        metres_to_go=metres_to_go(scenario, requirements),
        allowed_stiffness_n_m=allowed_stiffness(scenario, requirements),
        laws=tuple(check_law(scenario, law, requirements) for law in DESIGNED_LAWS),
        jams=tuple(jam_runs(scenario, tuple(DESIGNED_LAWS), progress=progress)),
    )


def _barrier_row(scenario: Scenario, to_go: float) -> BarrierRow:
    attraction, reach = (
        scenario.follower.attraction,
        scenario.follower.laws.conventional.reach_m,
    )
    farther = DesignRequirements(
        source_range_m=to_go + attraction.follow_distance_m + reach
    )
    needed = gain_for_barrier(scenario, "conventional", "stiffness_n_m", farther)
    return BarrierRow(to_go, needed, barrier_from_reach_n_m(scenario, to_go))
