"""Least damping that meets the usual thresholds, for several springs, and its cost.

The loop is the attraction's, sampled, with motor lag: springs and dampers of the
law come in as the contact mode, whose stability is asked for as well. What the
law does about rest, pushing off the source's own body, has its margins stated beside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.design.attraction_search import (
    attraction_damping_ratio,
    following_lag,
    with_attraction,
)
from analysis.linear.contact_mode import (
    contact_matrix,
    contact_spectral_radius,
    largest_contact_stiffness,
    motion_chain,
)
from analysis.linear.loop_margins import all_margins, loop_margins
from analysis.linear.loop_uncertainty import law_stiffness
from analysis.models.equilibria import follow_equilibrium
from analysis.models.linear_models import LinearModel
from analysis.models.open_loops import BreakPoint
from diagrams import Scenario, library_scenarios
from systems.framework.input_error import InputError

#: Springs beside the present one, as multiples of it.
_SPRINGS = (0.5, 1.0, 2.0, 4.0)
#: Dampers that are tried, as multiples of the critical one.
_DAMPERS = np.geomspace(0.05, 3.0, 30)
#: Where the loop is cut.
_CUTS: tuple[BreakPoint, ...] = ("sensor", "actuator")


@dataclass(frozen=True)
class GainThresholds:
    """What the gains are to meet."""

    damping_ratio: float = 0.4
    phase_margin_deg: float = 45.0
    sensitivity_peak: float = 2.0
    disk_margin: float = 2.0 / 3.0
    spare_ticks: int = 1
    """The contact mode stays stable with echoes so many ticks late."""


@dataclass(frozen=True)
class GainFigures:
    """What a pair of gains achieves, and what it costs."""

    stiffness_n_m: float
    """K_r, N/m."""
    damping_n_s_m: float
    """D_r, N s/m."""
    damping_ratio: float
    phase_margin_deg: float
    """The lesser one of sensor and actuator, deg."""
    gain_margin_db: float
    """The lesser one, up or down, dB."""
    sensitivity_peak: float
    """The greater one."""
    disk_margin: float
    """The lesser one."""
    delay_margin_s: float
    """The lesser one, s."""
    contact_radius: float
    """Of the contact mode with the spare ticks; stable below 1."""
    following_lag_m: float
    """Behind the follow point of a source that moves as the scenario's, m."""
    settling_s: float
    """To 2 % of a small deviation, s."""
    largest_law_stiffness_n_m: float
    """The stiffest law that does not swing before an obstacle, N/m."""


@dataclass(frozen=True)
class GainChoice:
    """The least damping for one spring."""

    stiffness_n_m: float
    """K_r, N/m."""
    figures: GainFigures | None
    """None: no damping meets the thresholds with this spring."""


@dataclass(frozen=True)
class WholeLoop:
    """Least margins of the loop with the law in it, over all cuts, at rest."""

    gain_margin_db: float
    """Up or down, dB."""
    phase_margin_deg: float
    """Lag or lead, deg."""
    disk_margin: float
    weakest: str
    """The cut loop with the least disk margin."""

    def meets(self, thresholds: GainThresholds) -> bool:
        """Whether it has the margins that are asked of the attraction's loop."""
        return (
            self.phase_margin_deg >= thresholds.phase_margin_deg
            and self.disk_margin >= thresholds.disk_margin
        )


@dataclass(frozen=True)
class RecommendedGains:
    """The current gains, and the least damping for each of several springs."""

    thresholds: GainThresholds
    scenario: str
    """Name in the library, or the file that a report writes beside itself."""
    law: str
    today: GainFigures
    choices: tuple[GainChoice, ...]
    recommended: GainFigures | None
    """With the current spring, or else the one with the least lag; none: nothing."""
    whole_loop: WholeLoop | None
    """With the recommended gains; none: nothing is recommended."""

    @property
    def command(self) -> str:
        """Simulates with the recommended gains; empty where there are none."""
        if self.recommended is None:
            return ""
        gains = self.recommended
        return (
            f"phonotaxis simulate {self.scenario} --law {self.law} "
            f"--set attraction.stiffness_n_m={gains.stiffness_n_m:g} "
            f"--set attraction.damping_n_s_m={gains.damping_n_s_m:g}"
        )

    @property
    def advice(self) -> str:
        """The recommendation and its cost, in words."""
        today, best = self.today, self.recommended
        if best is None:
            return (
                "No damping meets all requirements: the law is too stiff before an "
                "obstacle, or the motors are too slow. Lower the law's stiffness "
                "first."
            )
        same_spring = best.stiffness_n_m == today.stiffness_n_m
        if same_spring and best.damping_n_s_m <= today.damping_n_s_m:
            return "The current gains meet all requirements of the attraction."
        return (
            f"Recommended: `{self.command}`. It costs distance: P stays "
            f"{best.following_lag_m:.2f} m instead of {today.following_lag_m:.2f} m "
            "behind the follow point of the moving source. A shorter follow distance "
            "can make up for this, because P overshoots less. The gain is a faster "
            f"response: P settles to 2 % in {best.settling_s:.1f} s instead of "
            f"{today.settling_s:.1f} s, and a law may be as stiff as "
            f"{best.largest_law_stiffness_n_m:.0f} N/m instead of "
            f"{today.largest_law_stiffness_n_m:.0f} N/m before an obstacle. A larger "
            "K_r with a larger D_r has less lag and leaves less delay "
            f"margin.{self._of_the_law}"
        )

    @property
    def _of_the_law(self) -> str:
        """What the law adds to the attraction's loop, where that is too much."""
        whole = self.whole_loop
        if whole is None or whole.meets(self.thresholds):
            return ""
        return (
            " These numbers are for the attraction's loop alone. If the loop includes "
            "the law's push off the source's body, the same gains leave a gain margin "
            f"of {whole.gain_margin_db:.2f} dB and {whole.phase_margin_deg:.1f} deg "
            f"of phase (weakest: {whole.weakest})."
        )


def attraction_loop(scenario: Scenario, at: BreakPoint) -> LinearModel:
    """L of the attraction alone, sampled, along the line to a source at rest.

    Args:
        scenario: Gains, robot and plant are used.
        at: ``sensor``: the damper stays closed; ``actuator``: both are cut.

    Returns:
        One input and one output, both accelerations, m/s^2.
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


def gain_figures(scenario: Scenario, thresholds: GainThresholds) -> GainFigures:
    """What the scenario's K_r and D_r achieve.

    Args:
        scenario: Gains, robot and plant.
        thresholds: The latency that the contact mode is to spare, in ticks.

    Returns:
        Margins, lag, m, and settling, s.
    """
    margins = [loop_margins(attraction_loop(scenario, at)) for at in _CUTS]
    K_r = scenario.follower.attraction.stiffness_n_m
    z = np.linalg.eigvals(contact_matrix(scenario, K_r))
    slowest = -math.log(float(np.abs(z).max())) / scenario.tick_s

    def least(name: str) -> float:
        return min(float(getattr(m, name)) for m in margins)

    return GainFigures(
        stiffness_n_m=K_r,
        damping_n_s_m=scenario.follower.attraction.damping_n_s_m,
        damping_ratio=attraction_damping_ratio(scenario),
        phase_margin_deg=least("phase_margin_deg"),
        gain_margin_db=least("gain_margin_db"),
        sensitivity_peak=max(m.sensitivity_peak for m in margins),
        disk_margin=min(m.disk.alpha for m in margins),
        delay_margin_s=least("delay_margin_s"),
        contact_radius=_contact_radius(scenario, thresholds),
        following_lag_m=following_lag(scenario),
        settling_s=4.0 / slowest,
        largest_law_stiffness_n_m=largest_contact_stiffness(scenario) - K_r,
    )


def recommend_gains(
    scenario: Scenario,
    thresholds: GainThresholds | None = None,
    *,
    springs: Sequence[float] = _SPRINGS,
) -> RecommendedGains:
    """Finds the least D_r for each of several K_r.

    Args:
        scenario: Current gains, law, robot and plant.
        thresholds: What is to be met.
        springs: K_r that are tried, as multiples of the current one.

    Returns:
        The current gains, each choice with its figures, and the one recommended.

    Raises:
        InputError: There is no spring.
    """
    thresholds = thresholds or GainThresholds()
    today = scenario.follower.attraction.stiffness_n_m
    if today == 0.0:
        raise InputError(
            "attraction.stiffness_n_m",
            "is 0, so that there is no loop to recommend gains for; set it above 0",
        )
    choices = tuple(_choice(scenario, share * today, thresholds) for share in springs)
    best = _best(choices, today)
    known = scenario.name in library_scenarios()
    return RecommendedGains(
        thresholds,
        scenario.name if known else "scenario.yaml",
        scenario.only.law,
        gain_figures(scenario, thresholds),
        choices,
        best,
        _whole_loop(scenario, best) if best else None,
    )


def _best(choices: Sequence[GainChoice], K_r: float) -> GainFigures | None:
    found = [choice.figures for choice in choices if choice.figures]
    same = [f for f in found if f.stiffness_n_m == K_r]
    return min(same or found, key=lambda f: f.following_lag_m, default=None)


def _whole_loop(scenario: Scenario, gains: GainFigures) -> WholeLoop:
    chosen = with_attraction(scenario, gains.stiffness_n_m, gains.damping_n_s_m)
    loops = [found.margins for found in all_margins(follow_equilibrium(chosen))]
    weakest = min(loops, key=lambda loop: loop.disk.alpha)
    return WholeLoop(
        gain_margin_db=min(loop.gain_margin_db for loop in loops),
        phase_margin_deg=min(loop.phase_margin_deg for loop in loops),
        disk_margin=weakest.disk.alpha,
        weakest=weakest.name,
    )


def _choice(scenario: Scenario, K_r: float, thresholds: GainThresholds) -> GainChoice:
    critical = 2.0 * math.sqrt(K_r * scenario.only.robot.mass_kg)

    def meets(D_r: float) -> bool:
        return _meets(with_attraction(scenario, K_r, D_r), thresholds)

    below = 0.0
    for D_r in critical * _DAMPERS:
        if meets(D_r):
            least = _bisected(meets, below, float(D_r))
            chosen = with_attraction(scenario, K_r, least)
            return GainChoice(K_r, gain_figures(chosen, thresholds))
        below = float(D_r)
    return GainChoice(K_r, None)


def _bisected(meets: Callable[[float], bool], low: float, high: float) -> float:
    """Least value that meets, rounded up to two decimals, where that meets too."""
    while high - low > 1e-3 * high:
        middle = (low + high) / 2.0
        low, high = (low, middle) if meets(middle) else (middle, high)
    rounded = math.ceil(100.0 * high) / 100.0
    return rounded if meets(rounded) else high


def _meets(scenario: Scenario, thresholds: GainThresholds) -> bool:
    if attraction_damping_ratio(scenario) < thresholds.damping_ratio:
        return False
    if _contact_radius(scenario, thresholds) >= 1.0:
        return False
    for at in _CUTS:
        margins = loop_margins(attraction_loop(scenario, at))
        if (
            margins.phase_margin_deg < thresholds.phase_margin_deg
            or margins.sensitivity_peak > thresholds.sensitivity_peak
            or margins.disk.alpha < thresholds.disk_margin
        ):
            return False
    return True


def _contact_radius(scenario: Scenario, thresholds: GainThresholds) -> float:
    total = scenario.follower.attraction.stiffness_n_m + law_stiffness(scenario)
    return contact_spectral_radius(
        scenario, total, latency_ticks=thresholds.spare_ticks
    )
