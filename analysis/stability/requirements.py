"""Requirements on the gains of a robot, and checks of gains against them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from analysis.loops.contact_mode import largest_contact_stiffness
from analysis.loops.push_and_pull import (
    far_offset,
    injected_share,
    kinetic_energy,
    net_barrier,
    rest_offset,
    spring,
)
from analysis.loops.radial_law import radial_law
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError

#: A number may miss its bound by this share, because gains are rounded.
_ROUNDING = 0.01
#: A number may miss its bound by this share because of floating-point errors.
_EXACT = 1e-9


@dataclass(frozen=True)
class Requirement:
    """A bound of one number."""

    name: str
    bound: float
    unit: str
    at_least: bool = False
    """Whether the bound is a lower bound."""

    def check(self, value: float) -> Check:
        """Compares a number with the bound."""
        return Check(self.name, value, self.bound, self.unit, self.at_least)


@dataclass(frozen=True)
class Check:
    """One requirement, and the value that the gains achieve."""

    name: str
    value: float
    bound: float
    unit: str
    at_least: bool = False

    @property
    def ratio(self) -> float:
        """Value/bound for a lower bound, bound/value for an upper bound.

        The requirement is met if this ratio is at least 1. If the divisor is 0 or less,
        the ratio is infinite.
        """
        good, bad = self.value, self.bound
        if not self.at_least:
            good, bad = bad, good
        return good / bad if bad > 0.0 else math.inf

    @property
    def met(self) -> bool:
        """Whether the requirement is met, except for floating-point errors."""
        return self.ratio >= 1.0 - _EXACT

    @property
    def acceptable(self) -> bool:
        """Whether the requirement is met, or missed by 1 % or less.

        The rounding of gains can cause such a small miss.
        """
        return self.ratio >= 1.0 - _ROUNDING

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields and the three properties for the JSON document."""
        results = ("ratio", "met", "acceptable")
        return vars(self) | {name: getattr(self, name) for name in results}


@dataclass(frozen=True)
class Requirements:
    """Requirements on the attraction and on the gains of the laws.

    The stability report uses the same values as thresholds of its criteria. The first
    six fields are bounds for the control loop that moves the robot to the follow point.
    """

    damping_ratio: float = 0.4
    phase_margin_deg: float = 45.0
    gain_margin_db: float = 6.0
    """Least gain margin, up or down, dB."""
    sensitivity_peak: float = 2.0
    """Largest sensitivity peak M_s."""
    disk_margin: float = 2.0 / 3.0
    delay_margin_s: float = 0.1
    rest_offset_m: float = 0.1
    """Largest offset of a robot at rest due to the push away from the leader, m. The
    leader is the robot that carries the source."""
    far_offset_m: float = 0.03
    """Largest offset of a robot at rest due to an echo at the largest sensor range, m.
    The default is equal to the error of hearing at 1 m (Han 2019, tables 1 and 2)."""
    spare_latency_ticks: int = 1
    """Number of control periods. The motion in front of an obstacle must be stable even
    if echoes are later than in the model by this number. The model leaves out the
    travel time of echoes, which is up to 18 ms."""
    injected_share: float = 0.8
    """Largest power that the velocity term of the law may add to the motion, as a share
    of the power that the damping D_r removes."""
    source_range_m: float = 4.0
    """Largest distance of the source, m (Han 2019, tables 1 and 2)."""
    clearance_m: float = 0.25
    """Least clearance between P and the body of the leader during an overshoot, m."""

    def within_goal(self, scenario: Scenario) -> Requirements:
        """Returns a copy that allows any offset at rest with which P is in the goal.

        The default gains of the laws meet these requirements with the attraction of Han
        2019. This attraction is too soft for the offset that ``REQUIRED`` allows.
        """
        return replace(self, rest_offset_m=scenario.stop.goal_margin_m)

    def loop(self) -> Iterator[tuple[str, Requirement]]:
        """Yields requirements on the loop, each after its field of ``GainFigures``."""
        for field, name, unit in (
            ("damping_ratio", "damping ratio", "1"),
            ("phase_margin_deg", "phase margin", "deg"),
            ("gain_margin_db", "gain margin", "dB"),
            ("disk_margin", "disk margin", "1"),
            ("delay_margin_s", "delay margin", "s"),
        ):
            yield field, Requirement(name, getattr(self, field), unit, at_least=True)
        peak = Requirement("sensitivity peak", self.sensitivity_peak, "1")
        yield "sensitivity_peak", peak


#: Requirements of the stability report and of ``phonotaxis design``.
REQUIRED = Requirements()


@dataclass(frozen=True)
class LawDesign:
    """The gains of a law, and their checks against the requirements."""

    law: str
    gains: dict[str, float]
    """All parameters of the law, by field."""
    checks: tuple[Check, ...]

    def check(self, name: str) -> Check:
        """Returns the check with the given name."""
        return next(check for check in self.checks if check.name == name)

    @property
    def acceptable(self) -> bool:
        """Whether every check is ``acceptable``: met, or missed by 1 % or less."""
        return all(check.acceptable for check in self.checks)

    def to_dict(self) -> dict[str, Any]:
        """Returns the gains and the checks for the JSON document."""
        return vars(self) | {"acceptable": self.acceptable}


def with_gains(scenario: Scenario, law: str, **gains: float) -> Scenario:
    """Returns a copy of a scenario with other gains of one law, without validation.

    ``gains`` are values by field of the law's parameters.
    """
    parameters = getattr(scenario.follower.laws, law).model_copy(update=gains)
    laws = scenario.follower.laws.model_copy(update={law: parameters})
    return scenario.with_robot(laws=laws)


def meters_to_go(scenario: Scenario, requirements: Requirements) -> float:
    """Returns the distance from an obstacle to the follow point behind it, m.

    The source is straight ahead of the robot, at ``requirements.source_range_m``. The
    follow point is between the robot and the source, at the follow distance from the
    source. The obstacle is ahead of the robot at the reach rho_0 of the conventional
    law. Raises InputError if the follow point is not behind the obstacle.
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


def allowed_stiffness(scenario: Scenario, requirements: Requirements) -> float:
    """Returns the largest stiffness that a law may have near an obstacle, N/m.

    With a larger stiffness, the motion in front of an obstacle is unstable if echoes
    are ``spare_latency_ticks`` later than in the model. If the attraction alone is too
    stiff, the result is negative.
    """
    total = largest_contact_stiffness(
        scenario, latency_ticks=requirements.spare_latency_ticks
    )
    return total - scenario.follower.attraction.stiffness_n_m


def check_law(scenario: Scenario, law: str, requirements: Requirements) -> LawDesign:
    """Checks the gains of a law in a scenario against five requirements.

    Raises InputError if the law is not one of ``DESIGNED_LAWS``, or if the follow
    distance is too long; see ``meters_to_go``.
    """
    push = spring(law, scenario)
    to_go = meters_to_go(scenario, requirements)
    barrier, energy = net_barrier(push, scenario, to_go), kinetic_energy(scenario)
    slope = radial_law(scenario.with_robot(law=law)).stiffest_n_m
    allowed = allowed_stiffness(scenario, requirements)
    checks = (
        Requirement("barrier", energy, "J", at_least=True).check(barrier),
        Requirement("contact stiffness", allowed, "N/m").check(slope),
        Requirement("offset behind the source", requirements.rest_offset_m, "m").check(
            rest_offset(law, scenario)
        ),
        Requirement("offset by a far echo", requirements.far_offset_m, "m").check(
            far_offset(law, scenario)
        ),
        Requirement("energy put back", requirements.injected_share, "1").check(
            injected_share(law, scenario)
        ),
    )
    gains = getattr(scenario.follower.laws, law).model_dump()
    return LawDesign(law, gains, checks)
