"""Effects of sampling: stability conditions, poles by period, stability charts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.loops.contact_mode import contact_model, delayed_output, motion_chain
from analysis.loops.linear_models import LinearModel, growth_per_s
from diagrams.scenario.scenario import Scenario
from systems.framework.signals import TICK_S

Scheme = Literal["held acceleration", "held velocity", "held velocity, one tick late"]

#: Ways to sample a double integrator. The second is that of the diagram without motor
#: lag.
SCHEMES: tuple[Scheme, ...] = (
    "held acceleration",
    "held velocity",
    "held velocity, one tick late",
)
_CONDITIONS: dict[Scheme, str] = {
    "held acceleration": "K T / 2 < D < 2 / T",
    "held velocity": "D > 0 and 2 D T + K T^2 < 4",
    "held velocity, one tick late": "K T < D and 2 D T - K T^2 < 4",
}
#: A motor lag that counts as zero at the default tick, s. A shorter lag would reduce
#: the accuracy of the matrix exponential. The stiffest springs of the test are
#: proportional to 1/tick^2.
_NO_LAG_S = 1e-7
#: Sample periods to compute, s.
_PERIODS_S = np.geomspace(0.002, 4.0, 160)
#: Axes of the charts: K_r and D_r of ``gain_chart``, stiffness of ``gain_delay_chart``.
_SPRINGS_N_M = np.geomspace(0.1, 400.0, 60)
_DAMPERS_N_S_M = np.geomspace(0.05, 400.0, 60)
_ALL_SPRINGS_N_M = np.geomspace(0.2, 100.0, 50)


@dataclass(frozen=True)
class ConditionCheck:
    """Comparison of a closed-form stability condition with eigenvalues."""

    scheme: Scheme
    """How the double integrator of unit mass is sampled."""
    condition: str
    """Necessary and sufficient condition on stiffness K, damping D and period T."""
    pairs: int
    stable: int
    """Number of pairs that are stable by their eigenvalues."""
    mismatches: int
    """Number of pairs for which condition and eigenvalues disagree."""


def check_conditions(
    pairs: int = 10_000, seed: int = 1, *, tick_s: float = TICK_S
) -> tuple[ConditionCheck, ...]:
    """Tests the three stability conditions on random gains near their boundaries.

    The matrices of the held velocity are those of the blocks without motor lag. The
    matrices of the held acceleration come from ``control.sample_system``. All of
    ``SCHEMES`` are tested with the same random pairs (K, D).
    """
    rng, T = np.random.default_rng(seed), tick_s
    K = 10.0 ** rng.uniform(-1.0, math.log10(8.0 / T**2), pairs)
    D = 10.0 ** rng.uniform(-3.0, math.log10(4.0 / T), pairs)
    holds = {
        "held acceleration": (K * T / 2 < D) & (D < 2 / T),
        "held velocity": 2 * D * T + K * T**2 < 4,
        "held velocity, one tick late": (K * T < D) & (2 * D * T - K * T**2 < 4),
    }
    checks = []
    for scheme in SCHEMES:
        chain = _chain(scheme, tick_s)
        law = -np.stack([K, D], axis=1)
        matrices = chain.A + np.einsum("i,pj,jk->pik", chain.B[:, 0], law, chain.C)
        stable = np.abs(np.linalg.eigvals(matrices)).max(axis=1) < 1.0
        wrong = int(np.sum(stable != holds[scheme]))
        checks.append(
            ConditionCheck(scheme, _CONDITIONS[scheme], pairs, int(stable.sum()), wrong)
        )
    return tuple(checks)


def _chain(scheme: Scheme, tick_s: float) -> LinearModel:
    """Sampled model from the acceleration of a unit mass to position and velocity."""
    no_lag_s = _NO_LAG_S * (tick_s / TICK_S) ** 2
    built = motion_chain(Scenario(), motor_lag_s=no_lag_s, period_s=tick_s)
    if scheme == "held velocity":
        return built
    if scheme == "held velocity, one tick late":
        return delayed_output(built, "p_WP", 1)  # the velocity has no delay
    import control

    double = control.ss([[0, 1], [0, 0]], [[0], [1]], np.eye(2), np.zeros((2, 1)))
    A, B, C, D = control.ssdata(control.sample_system(double, tick_s))
    names = built.input_names, built.output_names
    return LinearModel(scheme, A, B, C, D, ("p", "v"), *names, tick_s)


@dataclass(frozen=True)
class PolesAgainstPeriod:
    """Poles of the target loop as a function of the sample period."""

    periods_s: NDArray[np.float64]
    """(n,) sample periods, s."""
    poles: NDArray[np.complex128]
    """(n, m) poles in the z plane."""
    today_s: float
    """Control period of the scenario, s."""
    longest_stable_s: float
    """Largest of the periods up to which all are stable, s."""

    @property
    def growth_per_s(self) -> NDArray[np.float64]:
        """(n,) growth rate of the slowest mode, 1/s; negative if it decays."""
        radius = np.abs(self.poles).max(axis=1)
        return np.asarray(growth_per_s(radius, self.periods_s))


def poles_against_period(
    scenario: Scenario,
    *,
    stiffness_n_m: float | None = None,
    periods_s: ArrayLike = _PERIODS_S,
) -> PolesAgainstPeriod:
    """Computes the poles along the line to the source for other sample periods.

    The loop has no latency: odometry compensates the latency of hearing, and an echo
    drives the wheels in the same control period. ``stiffness_n_m`` replaces the
    attraction's, for example with the spring of an obstacle added. ``periods_s`` are
    ascending.
    """
    periods = np.asarray(periods_s, dtype=float)
    stiffness = stiffness_n_m
    if stiffness is None:
        stiffness = scenario.follower.attraction.stiffness_n_m
    poles = np.zeros((len(periods), 3), dtype=complex)
    for row, period in zip(poles, periods, strict=True):
        found = contact_model(scenario, stiffness, period_s=float(period)).poles
        # In a long period the motor lag may vanish, and with it one pole.
        row[: len(found)] = found
    unstable = np.abs(poles).max(axis=1) >= 1.0
    first = int(np.argmax(unstable)) if unstable.any() else len(periods)
    return PolesAgainstPeriod(
        periods_s=periods,
        poles=poles,
        today_s=scenario.tick_s,
        longest_stable_s=float(periods[first - 1]) if first else 0.0,
    )


@dataclass(frozen=True)
class StabilityChart:
    """Growth rate of the slowest mode over two parameters."""

    title: str
    x_name: str
    """Name and unit."""
    y_name: str
    """Name and unit."""
    x: NDArray[np.float64]
    """(nx,)"""
    y: NDArray[np.float64]
    """(ny,)"""
    growth_per_s: NDArray[np.float64]
    """(ny, nx) growth rates, 1/s; negative where all modes decay."""
    today: tuple[float, float]
    """Values (x, y) in the scenario."""

    @property
    def stable_share(self) -> float:
        """Share of the chart's points that are stable, 0 to 1."""
        return float(np.mean(self.growth_per_s < 0.0))


def _growth(
    model: Callable[[Any, float], LinearModel], x: NDArray[Any], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(ny, nx) growth rates of the slowest mode of ``model(x, y)``, 1/s."""
    xs = x.tolist()
    return np.array([[model(a, b).growth_per_s for a in xs] for b in y.tolist()])


def gain_chart(
    scenario: Scenario,
    *,
    stiffnesses_n_m: ArrayLike = _SPRINGS_N_M,
    dampings_n_s_m: ArrayLike = _DAMPERS_N_S_M,
) -> StabilityChart:
    """Computes the stability of the sampled loop over two gains of the attraction.

    The gains are stiffness K_r (x) and damping D_r (y). The loop has motor lag, and no
    obstacle is near. The chart marks the gains of the scenario.
    """
    K, D = (
        scenario.follower.attraction.stiffness_n_m,
        scenario.follower.attraction.damping_n_s_m,
    )
    tick_s = scenario.tick_s
    x, y = np.asarray(stiffnesses_n_m, float), np.asarray(dampings_n_s_m, float)
    return StabilityChart(
        title=f"attraction, with motor lag and {tick_s * 1e3:g} ms sampling",
        x_name="K_r (N/m)",
        y_name="D_r (N s/m)",
        x=x,
        y=y,
        growth_per_s=_growth(
            lambda k, d: contact_model(scenario, k, damping_n_s_m=d), x, y
        ),
        today=(K, D),
    )


def gain_delay_chart(
    scenario: Scenario,
    *,
    delays_s: ArrayLike | None = None,
    stiffnesses_n_m: ArrayLike = _ALL_SPRINGS_N_M,
) -> StabilityChart:
    """Computes the stability over stiffness (y) and age of the measured position (x).

    The stiffness is the sum of all springs that act on this position. The ages, by
    default 0 to 1 s, are rounded to whole control periods. The chart marks the
    stiffness of the attraction.
    """
    tick_s = scenario.tick_s
    delays = np.arange(0.0, 1.0, 2 * tick_s) if delays_s is None else delays_s
    ticks = np.rint(np.asarray(delays, float) / tick_s).astype(int)
    y = np.asarray(stiffnesses_n_m, float)
    return StabilityChart(
        title="all springs together, on a position of some age",
        x_name="delay (s)",
        y_name="stiffness (N/m)",
        x=ticks * tick_s,
        y=y,
        growth_per_s=_growth(
            lambda n, k: contact_model(scenario, k, latency_ticks=n), ticks, y
        ),
        today=(0.0, scenario.follower.attraction.stiffness_n_m),
    )
