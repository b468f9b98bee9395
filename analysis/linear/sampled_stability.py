"""Sampling: closed-form conditions, poles against period, stability charts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.linear.contact_mode import contact_matrix, delayed_output, motion_chain
from analysis.models.linear_models import LinearModel
from diagrams.scenario.scenario import Scenario
from systems.framework.signals import TICK_S

Scheme = Literal["held acceleration", "held velocity", "held velocity, one tick late"]

#: Ways to sample a double integrator; the second is the built one without lag.
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
#: A motor lag that counts as none at the default tick, s; a shorter one costs the
#: exponential digits. The stiffest springs that are tried go with 1/tick^2.
_NO_LAG_S = 1e-7
#: Sample periods that are tried, s.
_PERIODS_S = np.geomspace(0.002, 4.0, 160)
#: Springs and dampers of the attraction's chart, and springs of the delay's.
_SPRINGS_N_M = np.geomspace(0.1, 400.0, 60)
_DAMPERS_N_S_M = np.geomspace(0.05, 400.0, 60)
_ALL_SPRINGS_N_M = np.geomspace(0.2, 100.0, 50)


@dataclass(frozen=True)
class ConditionCheck:
    """A closed-form condition against eigenvalues, at random gains."""

    scheme: Scheme
    """How the double integrator of unit mass is sampled."""
    condition: str
    """Stable exactly if this holds."""
    pairs: int
    """Random pairs (K, D)."""
    stable: int
    """Of them, stable by eigenvalues."""
    mismatches: int
    """Of them, in which the condition says otherwise."""


def check_conditions(
    pairs: int = 10_000, seed: int = 1, *, tick_s: float = TICK_S
) -> tuple[ConditionCheck, ...]:
    """Tests the three conditions on random pairs about their boundaries.

    The matrices are those of the blocks (without motor lag), and of
    ``control.sample_system`` for the held acceleration.

    Args:
        pairs: For each scheme.
        seed: Of the pairs.
        tick_s: The period, s.

    Returns:
        One a scheme, with the number of pairs on which both disagree.
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
    """From the acceleration of a unit mass to what the law sees of it."""
    no_lag_s = _NO_LAG_S * (tick_s / TICK_S) ** 2
    built = motion_chain(Scenario(), motor_lag_s=no_lag_s, period_s=tick_s)
    if scheme == "held velocity":
        return built
    if scheme == "held velocity, one tick late":
        return delayed_output(built, "p_WP", 1)  # the velocity is the mass's own
    import control

    double = control.ss([[0, 1], [0, 0]], [[0], [1]], np.eye(2), np.zeros((2, 1)))
    A, B, C, D = control.ssdata(control.sample_system(double, tick_s))
    names = built.input_names, built.output_names
    return LinearModel(scheme, A, B, C, D, ("p", "v"), *names, tick_s)


@dataclass(frozen=True)
class PolesAgainstPeriod:
    """Poles of the target loop for other sample periods."""

    periods_s: NDArray[np.float64]
    """(n,) s."""
    poles: NDArray[np.complex128]
    """(n, m) in the z plane."""
    today_s: float
    """The control period, s."""
    longest_stable_s: float
    """Largest of the periods below which all are stable, s."""

    @property
    def growth_per_s(self) -> NDArray[np.float64]:
        """(n,) exponent of the slowest mode, 1/s; negative where it decays."""
        radius = np.abs(self.poles).max(axis=1)
        return np.asarray(np.log(radius) / self.periods_s, dtype=float)


def poles_against_period(
    scenario: Scenario,
    *,
    stiffness_n_m: float | None = None,
    periods_s: ArrayLike = _PERIODS_S,
) -> PolesAgainstPeriod:
    """Poles along the line to the source, sampled at other periods.

    Hearing's tick does not count in it, for the odometry makes up for it, and
    an echo drives the wheels at once.

    Args:
        scenario: Attraction, robot and plant are used.
        stiffness_n_m: In place of K_r, as with an obstacle's spring, N/m.
        periods_s: (n,) sample periods, s, ascending.

    Returns:
        Up to three poles a period, z plane, and the longest stable period, s.
    """
    periods = np.asarray(periods_s, dtype=float)
    stiffness = stiffness_n_m
    if stiffness is None:
        stiffness = scenario.follower.attraction.stiffness_n_m
    poles = np.zeros((len(periods), 3), dtype=complex)
    for row, period in zip(poles, periods, strict=True):
        matrix = contact_matrix(scenario, stiffness, period_s=float(period))
        row[: len(matrix)] = np.linalg.eigvals(matrix)  # a lag may have gone by then
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
    """Exponent of the slowest mode over two parameters."""

    title: str
    """What is shown."""
    x_name: str
    """Name and unit of the horizontal parameter."""
    y_name: str
    """Name and unit of the vertical parameter."""
    x: NDArray[np.float64]
    """(nx,)"""
    y: NDArray[np.float64]
    """(ny,)"""
    growth_per_s: NDArray[np.float64]
    """(ny, nx) 1/s; negative where all decays."""
    today: tuple[float, float]
    """(x, y) of the scenario."""

    @property
    def stable_share(self) -> float:
        """Part of the chart's points that is stable."""
        return float(np.mean(self.growth_per_s < 0.0))


def _growth(
    matrix: Callable[[Any, float], NDArray[np.float64]],
    x: NDArray[Any],
    y: NDArray[np.float64],
    tick_s: float,
) -> NDArray[np.float64]:
    """(ny, nx) exponents of the slowest mode of ``matrix(x, y)``, 1/s."""

    def growth(a: Any, b: float) -> float:
        radius = float(np.abs(np.linalg.eigvals(matrix(a, b))).max())
        return math.log(max(radius, 1e-12)) / tick_s

    return np.array([[growth(a, b) for a in x.tolist()] for b in y.tolist()])


def gain_chart(
    scenario: Scenario,
    *,
    stiffnesses_n_m: ArrayLike = _SPRINGS_N_M,
    dampings_n_s_m: ArrayLike = _DAMPERS_N_S_M,
) -> StabilityChart:
    """Over K_r and D_r: sampled, with the motors' lag, away from obstacles.

    Args:
        scenario: Robot and plant are used; its gains are marked.
        stiffnesses_n_m: (nx,) K_r, N/m; by default 0.1 to 400.
        dampings_n_s_m: (ny,) D_r, N s/m; by default 0.05 to 400.

    Returns:
        Growth of the slowest mode, (ny, nx) 1/s.
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
            lambda k, d: contact_matrix(scenario, k, damping_n_s_m=d), x, y, tick_s
        ),
        today=(K, D),
    )


def gain_delay_chart(
    scenario: Scenario,
    *,
    delays_s: ArrayLike | None = None,
    stiffnesses_n_m: ArrayLike = _ALL_SPRINGS_N_M,
) -> StabilityChart:
    """Over the age of the position that the springs act on, and their stiffness.

    Delays are taken in whole ticks.

    Args:
        scenario: Robot, plant and damping are used; its spring is marked.
        delays_s: (nx,) ages, s; by default 0 to 1 s.
        stiffnesses_n_m: (ny,) all springs together, N/m; by default 0.2 to 100.

    Returns:
        Growth of the slowest mode, (ny, nx) 1/s.
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
            lambda n, k: contact_matrix(scenario, k, latency_ticks=n), ticks, y, tick_s
        ),
        today=(0.0, scenario.follower.attraction.stiffness_n_m),
    )
