"""Search for the least damping D_r that meets the usual thresholds, for several K_r.

K_r is the stiffness and D_r is the damping of the attraction, which pulls the robot to
the follow point near the source. The analyzed loop consists of the attraction with
sampling and motor lag. It does not contain the force of the law. Two other analyses
take this force into account:

- The motion in front of an obstacle, called the contact mode, must be stable.
- The law also pushes the robot away from the body of the source. ``WholeLoop`` has the
  margins of the loop with this push.
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
from analysis.laws.radial_law import radial_law
from analysis.linear.contact_mode import (
    contact_model,
    largest_contact_stiffness,
    motion_chain,
)
from analysis.linear.loop_margins import all_margins, loop_margins
from analysis.models.equilibria import follow_equilibrium
from analysis.models.linear_models import LinearModel
from analysis.models.open_loops import BreakPoint
from diagrams import Scenario, library_scenarios
from systems.framework.input_error import InputError

#: Values of K_r that are tried, as multiples of the current K_r.
_SPRINGS = (0.5, 1.0, 2.0, 4.0)
#: Values of D_r that are tried, as multiples of critical damping.
_DAMPERS = np.geomspace(0.05, 3.0, 30)
#: Places where the loop is cut.
_CUTS: tuple[BreakPoint, ...] = ("sensor", "actuator")


@dataclass(frozen=True)
class GainThresholds:
    """Thresholds that recommended gains must meet."""

    damping_ratio: float = 0.4
    phase_margin_deg: float = 45.0
    sensitivity_peak: float = 2.0
    disk_margin: float = 2.0 / 3.0
    spare_ticks: int = 1
    """The motion in front of an obstacle must be stable even if echoes are this many
    control periods late."""


@dataclass(frozen=True)
class GainFigures:
    """Performance figures of one pair of gains K_r and D_r."""

    stiffness_n_m: float
    """K_r, N/m."""
    damping_n_s_m: float
    """D_r, N s/m."""
    damping_ratio: float
    phase_margin_deg: float
    """Phase margin at the sensor or at the actuator, whichever is smaller, deg."""
    gain_margin_db: float
    """Gain margin at the sensor or at the actuator, whichever is smaller, dB."""
    sensitivity_peak: float
    """Sensitivity peak M_s at the sensor or at the actuator, whichever is larger."""
    disk_margin: float
    """Disk margin at the sensor or at the actuator, whichever is smaller."""
    delay_margin_s: float
    """Delay margin at the sensor or at the actuator, whichever is smaller, s."""
    contact_radius: float
    """Spectral radius of the motion in front of an obstacle; stable below 1."""
    following_lag_m: float
    """Lag of the robot behind the follow point of the moving source, m."""
    settling_s: float
    """Time in which a small deviation falls to 2 %, s."""
    largest_law_stiffness_n_m: float
    """Largest stiffness of a law with which the contact mode is stable, N/m."""


@dataclass(frozen=True)
class GainChoice:
    """The least damping that meets the thresholds for one K_r."""

    stiffness_n_m: float
    """K_r, N/m."""
    figures: GainFigures | None
    """Performance figures. None if no damping meets the thresholds with this K_r."""


@dataclass(frozen=True)
class WholeLoop:
    """Least margins at rest of the loop that includes the law, over all cuts."""

    gain_margin_db: float
    """Least gain margin for an increase or a decrease, dB."""
    phase_margin_deg: float
    """Least phase margin for a lag or a lead, deg."""
    disk_margin: float
    weakest: str
    """Name of the cut loop with the least disk margin."""

    def meets(self, thresholds: GainThresholds) -> bool:
        """Returns whether the phase margin and the disk margin meet the thresholds."""
        return (
            self.phase_margin_deg >= thresholds.phase_margin_deg
            and self.disk_margin >= thresholds.disk_margin
        )


@dataclass(frozen=True)
class RecommendedGains:
    """The current gains, and the least damping for each of several K_r."""

    thresholds: GainThresholds
    scenario: str
    """Name of a library scenario, or the file name of the scenario that a report
    writes."""
    law: str
    today: GainFigures
    choices: tuple[GainChoice, ...]
    recommended: GainFigures | None
    """Figures of the recommended gains. None if no gains meet the thresholds. If
    possible, the gains have the current K_r. Otherwise, they have the K_r with the
    least lag."""
    whole_loop: WholeLoop | None
    """Margins of the loop with the recommended gains and the law. None if no gains are
    recommended."""

    @property
    def command(self) -> str:
        """Command line that simulates the scenario with the recommended gains.

        The command is empty if no gains are recommended.
        """
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
        """Sentences about the margins with the law, if these margins are too small."""
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
    """Returns the sampled open loop of the attraction without the force of the law.

    The attraction consists of a spring and a damper. The robot moves along the line to
    a source at rest.

    Args:
        scenario: The scenario with the gains, the robot, and the plant.
        at: Where the loop is cut. A cut at ``sensor`` opens the path of the spring
            only. A cut at ``actuator`` opens the paths of both the spring and the
            damper.

    Returns:
        The model of the open loop. Its input and its output are accelerations, m/s^2.
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
    """Computes performance figures of the stiffness K_r and damping D_r of a scenario.

    Args:
        scenario: The scenario with the gains, the robot, and the plant.
        thresholds: The thresholds, of which only ``spare_ticks`` is used.

    Returns:
        The performance figures. The loop is cut at the sensor and at the actuator. Each
        margin is the smaller of the margins of the two cuts.
    """
    margins = [loop_margins(attraction_loop(scenario, at)) for at in _CUTS]
    K_r = scenario.follower.attraction.stiffness_n_m
    motion = contact_model(scenario, K_r)

    def least(name: str) -> float:
        return min(float(getattr(m, name)) for m in margins)

    return GainFigures(
        stiffness_n_m=K_r,
        damping_n_s_m=scenario.follower.attraction.damping_n_s_m,
        damping_ratio=motion.damping_ratio,
        phase_margin_deg=least("phase_margin_deg"),
        gain_margin_db=least("gain_margin_db"),
        sensitivity_peak=max(m.sensitivity_peak for m in margins),
        disk_margin=min(m.disk.alpha for m in margins),
        delay_margin_s=least("delay_margin_s"),
        contact_radius=_contact_radius(scenario, thresholds),
        following_lag_m=following_lag(scenario),
        settling_s=motion.settling_s,
        largest_law_stiffness_n_m=largest_contact_stiffness(scenario) - K_r,
    )


def recommend_gains(
    scenario: Scenario,
    thresholds: GainThresholds | None = None,
    *,
    springs: Sequence[float] = _SPRINGS,
) -> RecommendedGains:
    """Finds the least damping D_r for each of several stiffnesses K_r.

    Args:
        scenario: The scenario with the current gains, the law, the robot, and the
            plant.
        thresholds: Thresholds that the gains must meet. None means the default
            thresholds.
        springs: Values of K_r that are tried, as multiples of the current K_r.

    Returns:
        The current gains, the least D_r for each K_r, and the recommended gains.

    Raises:
        InputError: The current K_r is 0.
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
    """Returns the least value that meets the thresholds, by bisection.

    The value is rounded up to two decimals, unless the rounded value fails.
    """
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
    total = scenario.follower.attraction.stiffness_n_m
    total += radial_law(scenario).stiffest_n_m
    model = contact_model(scenario, total, latency_ticks=thresholds.spare_ticks)
    return model.spectral_radius
