"""Search for an attraction that meets the requirements, for several stiffnesses K_r.

The attraction is the virtual spring (stiffness K_r) and damper (damping D_r) that pull
the robot to the follow point. The follow point has a given distance, the follow
distance, from the source. The law is the virtual force that pushes the robot away from
obstacles. The search has these steps:

1. For each of several K_r, find the least D_r with which the loop to the follow point
   has the required margins, and with which the motion in front of an obstacle (the
   contact mode) is stable. The model of the loop has sampling and motor lag. It leaves
   out the force of the law.
2. If the current K_r and D_r meet these requirements, keep them. Otherwise, keep the
   current K_r and take the D_r from step 1. If no D_r suffices for the current K_r,
   take the other K_r with which the robot lags least behind a moving source.
3. Simulate the overshoot when the robot brakes from top speed. If the follow distance
   is too short for this overshoot, increase it.
4. If the gains of the scenario's law miss a requirement, choose new gains. The law also
   pushes the robot away from the leader, which is the robot that carries the source.
   Increase the follow distance until this push shifts the robot little enough.
5. If the motion in front of an obstacle is unstable with the new gains of the law,
   search for the least D_r again, now with these gains.

The margins of step 1 leave out the push away from the leader. ``WholeLoop`` has the
margins of the loop with this push.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from analysis.loops.contact_mode import (
    contact_model,
    largest_contact_stiffness,
    motion_chain,
)
from analysis.loops.equilibria import follow_equilibrium
from analysis.loops.ideal_scenarios import changed, ideal_scenario
from analysis.loops.linear_models import LinearModel
from analysis.loops.loop_margins import all_margins, loop_margins
from analysis.loops.margin_results import LoopMargins
from analysis.loops.open_loops import BreakPoint
from analysis.loops.push_and_pull import DESIGNED_LAWS
from analysis.loops.radial_law import radial_law
from analysis.stability.gain_search import search_gains
from analysis.stability.requirements import (
    Check,
    LawDesign,
    Requirement,
    Requirements,
    check_law,
)
from diagrams import library_scenarios
from diagrams.running.simulation import simulate
from diagrams.scenario.participants import LawGains
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.parameters import AttractionParameters

#: Values of K_r that are tried, as multiples of the current K_r.
_SPRINGS = (0.5, 1.0, 2.0, 4.0)
#: Values of D_r that are tried, as multiples of critical damping.
_DAMPERS = np.geomspace(0.05, 3.0, 30)
#: Places at which the loop is cut to compute its margins.
_CUTS: tuple[BreakPoint, ...] = ("sensor", "actuator")
#: Largest number of rounds of steps 3 to 5. Usually, two rounds suffice.
_ROUNDS = 4
#: The follow distance is rounded up to a multiple of this step, m.
_STEP_M = 0.05
#: Simulation of the overshoot. ``_APPROACH_M``: initial distance of the source, m. On
#: this distance, P reaches its top speed. ``_STAND_OFF_M``: follow distance, m. With
#: this distance, P stops in front of the source.
_APPROACH_M, _STAND_OFF_M = 8.0, 3.0


@dataclass(frozen=True)
class GainFigures:
    """Performance figures of one pair of gains K_r and D_r.

    The loop is cut once at the sensor and once at the actuator. Each margin, and the
    sensitivity peak M_s, is the worse of the two values.
    """

    stiffness_n_m: float
    """K_r, N/m."""
    damping_n_s_m: float
    """D_r, N s/m."""
    damping_ratio: float
    phase_margin_deg: float
    gain_margin_db: float
    sensitivity_peak: float
    disk_margin: float
    delay_margin_s: float
    """Smallest ratio of phase lag margin to frequency over all gain crossovers, s."""
    contact_radius: float
    """Spectral radius of the motion in front of an obstacle, where the law is stiffest.
    The motion is stable if the radius is below 1."""
    following_lag_m: float
    """Distance of the robot behind the follow point while the source moves at its
    speed, m."""
    settling_s: float
    """Time in which a small deviation falls to 2 %, s."""
    largest_law_stiffness_n_m: float
    """Largest stiffness of a law with which the motion in front of an obstacle is
    stable, N/m."""


@dataclass(frozen=True)
class GainChoice:
    """The least damping that meets the requirements for one K_r."""

    stiffness_n_m: float
    """K_r, N/m."""
    figures: GainFigures | None
    """Performance figures. None if no damping meets the requirements with this K_r."""


@dataclass(frozen=True)
class WholeLoop:
    """Least stability margins of the loop with the force of the law, over all cuts.

    The robot rests at its equilibrium behind the leader. Gain margins cover both a
    higher and a lower gain. Phase margins cover both a lag and a lead.
    """

    gain_margin_db: float
    phase_margin_deg: float
    disk_margin: float
    weakest: str
    """Name of the cut loop with the least disk margin."""

    def meets(self, requirements: Requirements) -> bool:
        """Returns whether all three margins meet the requirements."""
        limits = dict(requirements.loop())
        fields = ("gain_margin_db", "phase_margin_deg", "disk_margin")
        return all(limits[field].check(getattr(self, field)).met for field in fields)


@dataclass(frozen=True)
class RecommendedGains:
    """The current gains, the least D_r for several K_r, and the recommended gains."""

    requirements: Requirements
    scenario: Scenario
    """Scenario with the current gains."""
    today: GainFigures
    """Performance figures of the current K_r and D_r."""
    choices: tuple[GainChoice, ...]
    """The least D_r for several K_r, with the current gains of the law."""
    chosen: Scenario | None
    """Scenario with the recommended K_r, D_r, follow distance, and gains of its law.
    None if no gains meet the requirements."""
    recommended: GainFigures | None
    """Performance figures of the recommended K_r and D_r. None if there are none."""
    law: LawDesign | None
    """Recommended gains of the law, and their checks. None without a recommendation,
    and for a law that is not in ``DESIGNED_LAWS``."""
    whole_loop: WholeLoop | None
    """Margins with the recommended gains. None if there are none."""

    def to_dict(self) -> dict[str, Any]:
        """Returns the figures and the recommended gains for the JSON document."""
        return {
            "requirements": self.requirements,
            "law": self.scenario.only.law,
            "today": self.today,
            "choices": self.choices,
            "recommended": self.recommended,
            "settings": self.settings,
            "law_checks": self.law.checks if self.law else (),
            "whole_loop": self.whole_loop,
        }

    @property
    def settings(self) -> dict[str, float]:
        """Recommended values that differ from the current ones, by field.

        An example of a field is ``attraction.damping_n_s_m``.
        """
        if self.chosen is None:
            return {}
        now, then = self.scenario.follower, self.chosen.follower
        groups: list[tuple[str, Any, Any]] = [
            ("attraction", now.attraction, then.attraction)
        ]
        if self.law is not None:
            name = self.law.law
            old, new = getattr(now.laws, name), getattr(then.laws, name)
            groups.append((f"laws.{name}", old, new))
        return {
            f"{group}.{field}": value
            for group, old, new in groups
            for field, value in new.model_dump().items()
            if value != getattr(old, field)
        }

    @property
    def command(self) -> str:
        """Command line that simulates the recommended gains; empty if none exist."""
        if self.chosen is None:
            return ""
        name = self.scenario.name
        words = [
            "phonotaxis simulate",
            name if name in library_scenarios() else f"{name}.yaml",
            f"--law {self.scenario.only.law}",
            *(f"--set {field}={value:g}" for field, value in self.settings.items()),
        ]
        return " ".join(words)

    @property
    def advice(self) -> str:
        """The recommendation and its cost, in words."""
        today, best = self.today, self.recommended
        if best is None:
            return (
                "No gains meet all requirements: the law is too stiff before an "
                "obstacle, or the motors are too slow. Lower the law's stiffness "
                "first."
            )
        if not self.settings:
            return f"The current gains meet all requirements.{self._of_the_law}"
        return (
            f"Recommended: `{self.command}`. With these gains, P stays "
            f"{best.following_lag_m:.2f} m instead of {today.following_lag_m:.2f} m "
            "behind the follow point of the moving source. P settles to 2 % in "
            f"{best.settling_s:.1f} s instead of {today.settling_s:.1f} s, and a law "
            f"may be as stiff as {best.largest_law_stiffness_n_m:.0f} N/m instead of "
            f"{today.largest_law_stiffness_n_m:.0f} N/m before an obstacle. A larger "
            "K_r with a larger D_r has less lag and leaves less delay "
            f"margin.{self._unmet}{self._of_the_law}"
        )

    @property
    def _unmet(self) -> str:
        """Sentence about the requirements that the law cannot meet."""
        checks = self.law.checks if self.law else ()
        unmet = [check.name for check in checks if not check.acceptable]
        if not unmet:
            return ""
        return f" The law does not meet these requirements: {', '.join(unmet)}."

    @property
    def _of_the_law(self) -> str:
        """Sentences about the margins with the law, if these margins are too small."""
        whole = self.whole_loop
        if whole is None or whole.meets(self.requirements):
            return ""
        return (
            " These numbers are for the attraction's loop alone. If the loop includes "
            "the law's push off the source's body, the same gains leave a gain margin "
            f"of {whole.gain_margin_db:.2f} dB and {whole.phase_margin_deg:.1f} deg "
            f"of phase (weakest: {whole.weakest})."
        )


def recommend_gains(
    scenario: Scenario,
    requirements: Requirements | None = None,
    *,
    springs: Sequence[float] = _SPRINGS,
) -> RecommendedGains:
    """Finds gains of the attraction and of the law that meet the requirements.

    ``springs`` are the values of K_r to try, as multiples of the current K_r. Raises
    InputError if the current K_r is 0, or if no gains of the law meet a requirement
    that must be met.
    """
    requirements = requirements or Requirements()
    K_r = scenario.follower.attraction.stiffness_n_m
    if K_r == 0.0:
        raise InputError(
            "attraction.stiffness_n_m",
            "is 0, so that there is no loop to recommend gains for; set it above 0",
        )
    today = gain_figures(scenario, requirements)
    choices = tuple(
        least_damping(scenario, share * K_r, requirements) for share in springs
    )
    fits = all(check.met for check in _checks(scenario, requirements))
    best = today if fits else _best(choices, K_r)
    chosen, law = _chosen(scenario, best, requirements), scenario.only.law
    return RecommendedGains(
        requirements=requirements,
        scenario=scenario,
        today=today,
        choices=choices,
        chosen=chosen,
        recommended=gain_figures(chosen, requirements) if chosen else None,
        law=check_law(chosen, law, requirements)
        if chosen and law in DESIGNED_LAWS
        else None,
        whole_loop=_whole_loop(chosen) if chosen else None,
    )


def _best(choices: Sequence[GainChoice], K_r: float) -> GainFigures | None:
    found = [choice.figures for choice in choices if choice.figures]
    same = [f for f in found if f.stiffness_n_m == K_r]
    return min(same or found, key=lambda f: f.following_lag_m, default=None)


def _chosen(
    scenario: Scenario, best: GainFigures | None, requirements: Requirements
) -> Scenario | None:
    """Repeats steps 3 to 5 of the module from ``best``. None if no gains suffice."""
    for _ in range(_ROUNDS):
        if best is None:
            return None
        scenario = with_attraction(scenario, best.stiffness_n_m, best.damping_n_s_m)
        scenario = with_follow_distance(scenario, requirements)
        if _contact(scenario, requirements).stable:
            return scenario
        best = least_damping(scenario, best.stiffness_n_m, requirements).figures
    return None


def with_follow_distance(scenario: Scenario, requirements: Requirements) -> Scenario:
    """Returns a copy with a follow distance and gains of the law that fit each other.

    The follow distance is at least the current one, and leaves room for the overshoot.
    If the tuning of a law ``sets_follow_distance``, the law also shifts P at rest by at
    most ``rest_offset_m`` at this distance. The gains are those of
    ``fitting_gains``. For a law that is not in ``DESIGNED_LAWS``, the gains stay.
    """
    law = scenario.only.law
    least = follow_distance(scenario, requirements, braking_overshoot(scenario))
    follow = max(least, scenario.follower.attraction.follow_distance_m)
    while True:
        attraction = scenario.follower.attraction.model_copy(
            update={"follow_distance_m": round(follow, 2)}
        )
        scenario = scenario.with_robot(attraction=attraction)
        if law not in DESIGNED_LAWS:
            return scenario
        scenario = scenario.with_robot(laws=fitting_gains(scenario, requirements, law))
        offset = check_law(scenario, law, requirements).check(
            "offset behind the source"
        )
        if offset.acceptable or not DESIGNED_LAWS[law].sets_follow_distance:
            return scenario
        follow += _STEP_M


def fitting_gains(
    scenario: Scenario, requirements: Requirements, *laws: str
) -> LawGains:
    """Returns the gains of all laws of a scenario.

    Those of ``laws`` that miss a requirement get new gains. All other gains stay.
    """
    unfit = [x for x in laws if not check_law(scenario, x, requirements).acceptable]
    return search_gains(scenario, requirements, laws=unfit)


def _whole_loop(chosen: Scenario) -> WholeLoop:
    loops = [found.margins for found in all_margins(follow_equilibrium(chosen))]
    weakest = min(loops, key=lambda loop: loop.disk.alpha)
    return WholeLoop(
        gain_margin_db=min(loop.gain_margin_db for loop in loops),
        phase_margin_deg=min(loop.phase_margin_deg for loop in loops),
        disk_margin=float(weakest.disk.alpha),
        weakest=weakest.name,
    )


def least_damping(
    scenario: Scenario, K_r: float, requirements: Requirements
) -> GainChoice:
    """Finds the least damping D_r that meets the requirements for one stiffness K_r.

    ``K_r`` is in N/m. D_r is at most three times the damping that is critical for K_r
    and the virtual mass.
    """
    critical = 2.0 * math.sqrt(K_r * scenario.only.robot.mass_kg)

    def meets(D_r: float) -> bool:
        checks = _checks(with_attraction(scenario, K_r, D_r), requirements)
        return all(check.met for check in checks)

    below = 0.0
    for D_r in critical * _DAMPERS:
        if meets(D_r):
            least = _bisected(meets, below, float(D_r))
            chosen = with_attraction(scenario, K_r, least)
            return GainChoice(K_r, gain_figures(chosen, requirements))
        below = float(D_r)
    return GainChoice(K_r, None)


def _bisected(meets: Callable[[float], bool], low: float, high: float) -> float:
    """Bisects between a value that fails (``low``) and one that meets (``high``).

    The result is rounded up to two decimals if the rounded value also meets.
    """
    while high - low > 1e-3 * high:
        middle = (low + high) / 2.0
        low, high = (low, middle) if meets(middle) else (middle, high)
    rounded = math.ceil(100.0 * high) / 100.0
    return rounded if meets(rounded) else high


def _checks(scenario: Scenario, requirements: Requirements) -> Iterator[Check]:
    """Yields the checks of K_r and D_r. The checks that take the least time come first.

    The caller can stop at the first check that is not met.
    """
    limits = dict(requirements.loop())
    K_r = scenario.follower.attraction.stiffness_n_m
    ratio = contact_model(scenario, K_r).damping_ratio
    yield limits.pop("damping_ratio").check(ratio)
    growth = _contact(scenario, requirements).growth_per_s
    yield Requirement("growth at an obstacle", 0.0, "1/s").check(growth)
    for at in _CUTS:
        margins = _margins(loop_margins(attraction_loop(scenario, at)))
        for field, requirement in limits.items():
            yield requirement.check(margins[field])


def _margins(loop: LoopMargins) -> dict[str, float]:
    fields = (
        "phase_margin_deg",
        "gain_margin_db",
        "delay_margin_s",
        "sensitivity_peak",
    )
    return {name: getattr(loop, name) for name in fields} | {
        "disk_margin": loop.disk.alpha
    }


def _contact(scenario: Scenario, requirements: Requirements) -> LinearModel:
    """Returns the motion in front of an obstacle, at the distance of the stiffest push.

    Echoes are late by ``spare_latency_ticks``.
    """
    total = scenario.follower.attraction.stiffness_n_m
    total += radial_law(scenario).stiffest_n_m
    late = requirements.spare_latency_ticks
    return contact_model(scenario, total, latency_ticks=late)


def attraction_loop(scenario: Scenario, at: BreakPoint) -> LinearModel:
    """Returns the sampled open loop of the attraction without the force of the law.

    The attraction consists of a spring and a damper. The robot moves along the line to
    a source at rest. A cut at the ``sensor`` opens the feedback by the spring, and the
    feedback by the damper stays closed. A cut at the ``actuator`` opens the feedback by
    spring and damper. The input and the output are accelerations, m/s^2.
    """
    chain = motion_chain(scenario)
    mass = scenario.only.robot.mass_kg
    spring = scenario.follower.attraction.stiffness_n_m / mass * chain.C[:1]
    damper = scenario.follower.attraction.damping_n_s_m / mass * chain.C[1:]
    inner = chain.B @ damper if at == "sensor" else np.zeros_like(chain.A)
    return replace(
        chain,
        name=f"L of the attraction, at the {at}",
        A=chain.A - inner,
        C=spring if at == "sensor" else spring + damper,
        D=np.zeros((1, 1)),
        output_names=("acceleration",),
    )


def gain_figures(scenario: Scenario, requirements: Requirements) -> GainFigures:
    """Computes performance figures of the stiffness K_r and damping D_r of a scenario.

    Only the field ``spare_latency_ticks`` of ``requirements`` is used.
    """
    both = [_margins(loop_margins(attraction_loop(scenario, at))) for at in _CUTS]
    worst = {
        field: (max if field == "sensitivity_peak" else min)(m[field] for m in both)
        for field in both[0]
    }
    attraction = scenario.follower.attraction
    K_r, D_r = attraction.stiffness_n_m, attraction.damping_n_s_m
    motion = contact_model(scenario, K_r)
    return GainFigures(
        stiffness_n_m=K_r,
        damping_n_s_m=D_r,
        damping_ratio=motion.damping_ratio,
        contact_radius=_contact(scenario, requirements).spectral_radius,
        following_lag_m=D_r / K_r * scenario.source.speed_m_s,
        settling_s=motion.settling_s,
        largest_law_stiffness_n_m=largest_contact_stiffness(scenario) - K_r,
        **worst,
    )


def braking_overshoot(scenario: Scenario) -> float:
    """Simulates a braking robot and returns its overshoot past the follow point, m.

    The source is at rest, and the robot approaches it at top speed. The simulation has
    exact hearing, no obstacle, and no force of the law. If the robot does not
    overshoot, the result is 0.
    """
    changes = {
        "law": "none",
        "duration_s": 15.0,
        "obstacles": (),
        "start": {"position_m": [0.0, 0.0], "heading_deg": 0.0},
        "attraction": {"follow_distance_m": _STAND_OFF_M},
        "source": {"waypoints_m": [[_APPROACH_M, 0.0]]},
    }
    run = simulate(changed(ideal_scenario(scenario), changes))
    return max(0.0, _STAND_OFF_M - float(run.columns["source_range_true"].min()))


def follow_distance(
    scenario: Scenario, requirements: Requirements, overshoot_m: float
) -> float:
    """Returns the least follow distance that leaves room for an overshoot, m.

    If the control point P passes the follow point by ``overshoot_m``, P still keeps
    ``requirements.clearance_m`` to the body of the leader, which carries the source.
    The result is rounded up to a multiple of 5 cm.
    """
    room = scenario.source.length_m / 2.0 + requirements.clearance_m
    least = overshoot_m + room
    return round(math.ceil(least / _STEP_M - 1e-9) * _STEP_M, 2)


def with_attraction(scenario: Scenario, K_r: float, D_r: float) -> Scenario:
    """Returns a copy of a scenario with other gains K_r, N/m, and D_r, N s/m."""
    attraction = AttractionParameters.model_validate(
        scenario.follower.attraction.model_dump()
        | {"stiffness_n_m": K_r, "damping_n_s_m": D_r}
    )
    return scenario.with_robot(attraction=attraction)
