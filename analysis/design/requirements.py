"""What the laws' gains must achieve, and how far a set of gains does."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from analysis.laws.push_and_pull import (
    far_offset,
    injected_share,
    kinetic_energy,
    net_barrier,
    rest_offset,
    spring,
    stiffest,
)
from analysis.linear.contact_mode import largest_contact_stiffness
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: Gains are rounded; a bound holds to within the rounding.
_ROUNDING = 0.01
#: A figure that is off its bound by less is off by the rounding of floats alone.
_EXACT = 1e-9


@dataclass(frozen=True)
class DesignRequirements:
    """Bounds that the scenario does not say itself."""

    source_range_m: float = 4.0
    """The source is this far away at most, m: Han 2019, tables 1 and 2."""
    spare_latency_ticks: int = 1
    """Periods by which echoes may be older than in the model, which leaves out
    their travelling time, up to 18 ms."""
    far_offset_m: float = 0.03
    """An echo at the sensors' limit may push a resting robot so far, m: what
    hearing errs by at 1 m (Han 2019, tables 1 and 2)."""
    injected_share: float = 0.8
    """Share of D_r's dissipation that the velocity term may put back."""
    damping: float = 0.7
    """Least damping ratio of the loop to the follow point."""
    clearance_m: float = 0.25
    """Room left to the master robot's body when P overshoots, m."""
    offset_reserve_m: float = 0.1
    """Left of the goal by an attraction of one's own, m: cones and an oblique
    approach add up to 6 cm to the offset, hearing errs by 2 to 7 cm at 1 m."""


@dataclass(frozen=True)
class Check:
    """One requirement, and what was achieved."""

    name: str
    value: float
    bound: float
    unit: str
    at_least: bool = False
    """Whether the bound is a lower one."""

    @property
    def ratio(self) -> float:
        """How well it is met: 1 is just."""
        good, bad = self.value, self.bound
        if not self.at_least:
            good, bad = bad, good
        return good / bad if bad > 0.0 else math.inf

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.ratio >= 1.0 - _EXACT

    @property
    def acceptable(self) -> bool:
        """Whether it is met, to the rounding of the gains."""
        return self.ratio >= 1.0 - _ROUNDING


@dataclass(frozen=True)
class LawDesign:
    """A law's gains held against the requirements."""

    law: str
    gains: dict[str, float]
    """Fields of the law's parameters."""
    checks: tuple[Check, ...]

    def check(self, name: str) -> Check:
        """One of the checks."""
        return next(check for check in self.checks if check.name == name)

    @property
    def acceptable(self) -> bool:
        """Whether every requirement is met, to the rounding of the gains."""
        return all(check.acceptable for check in self.checks)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        checks = [
            vars(c)
            | {name: getattr(c, name) for name in ("ratio", "met", "acceptable")}
            for c in self.checks
        ]
        return vars(self) | {"acceptable": self.acceptable, "checks": checks}


def with_gains(scenario: Scenario, law: str, **gains: float) -> Scenario:
    """The same scenario with some gains of a law changed, unchecked.

    Args:
        scenario: Whose gains are changed; it stays as it is.
        law: As ``Scenario.law``.
        **gains: New values by field of the law's parameters, in the field's unit.

    Returns:
        A copy.
    """
    parameters = getattr(scenario.follower.laws, law).model_copy(update=gains)
    laws = scenario.follower.laws.model_copy(update={law: parameters})
    return scenario.with_robot(laws=laws)


def metres_to_go(scenario: Scenario, requirements: DesignRequirements) -> float:
    """From an obstacle at rho_0 to where the attraction rests, m, at most.

    Args:
        scenario: Follow distance and rho_0.
        requirements: The source's largest range.

    Returns:
        m, above 0.

    Raises:
        InputError: Nothing is left of the source's range.
    """
    follow = scenario.follower.attraction.follow_distance_m
    reach = scenario.follower.laws.conventional.reach_m
    left = requirements.source_range_m - follow - reach
    if left <= 0.0:
        raise InputError(
            "attraction.follow_distance_m",
            f"{follow} m and a reach of {reach} m leave "
            f"nothing of the {requirements.source_range_m} m to the source; lower it",
        )
    return left


def allowed_stiffness(scenario: Scenario, requirements: DesignRequirements) -> float:
    """Stiffest push with which the motion before an obstacle is stable, N/m.

    Args:
        scenario: Robot, plant and attraction.
        requirements: The latency that is to be spared, in ticks.

    Returns:
        N/m; negative where the attraction alone is too stiff.
    """
    total = largest_contact_stiffness(
        scenario, latency_ticks=requirements.spare_latency_ticks
    )
    return total - scenario.follower.attraction.stiffness_n_m


def check_law(
    scenario: Scenario, law: str, requirements: DesignRequirements
) -> LawDesign:
    """Holds a law's gains, as they stand in the scenario, against requirements.

    Args:
        scenario: Gains, robot, plant and sensors.
        law: As ``Scenario.law``.
        requirements: Bounds.

    Returns:
        The law's gains, and five figures beside their bounds.

    Raises:
        InputError: The law has no gains to choose, or see ``metres_to_go``.
    """
    push = spring(law, scenario)
    to_go = metres_to_go(scenario, requirements)
    barrier, energy = net_barrier(push, scenario, to_go), kinetic_energy(scenario)
    slope, allowed = stiffest(law, scenario), allowed_stiffness(scenario, requirements)
    rest, far = rest_offset(law, scenario), far_offset(law, scenario)
    room, share = scenario.stop.goal_margin_m, injected_share(law, scenario)
    checks = (
        Check("barrier", barrier, energy, "J", at_least=True),
        Check("contact stiffness", slope, allowed, "N/m"),
        Check("offset behind the source", rest, room, "m"),
        Check("offset by a far echo", far, requirements.far_offset_m, "m"),
        Check("energy put back", share, requirements.injected_share, "1"),
    )
    gains = getattr(scenario.follower.laws, law).model_dump()
    return LawDesign(law, gains, checks)
