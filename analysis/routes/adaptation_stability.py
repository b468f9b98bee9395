"""Analyzes whether the gains of a law that adapts them stay bounded.

The gains are the stiffness K and the damping D between the control point P and a target
that moves along the route. The analysis covers a Lyapunov function, the drift of K
under a constant push, a robot that a wall holds (a jam), and the critical adaptation
rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.routes.point_run import PointLoop, run_point
from analysis.routes.route_loop import route_law
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.impedance_sensitivity import sensitivity_sources
from systems.laws.trajectory.reference_model import held_matrices, nominal_poles
from systems.laws.trajectory.sampled_bounds import pull_through_m
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import target_force

# Durations of a run with the Lyapunov function and of a run for the critical rate, s.
_LEARN_S, _CRITICAL_S = 60.0, 60.0
# Initial gains divided by desired gains in a run with the Lyapunov function.
_OFF = 0.5
# The adaptation counts as running away if a gain (N/m or N s/m), a position (m) or a
# velocity (m/s) exceeds this value.
_WILD = 1e4
# Adaptation rates to try for an amplitude of 1 m, ten per decade, in the unit of
# ``AdaptationStability.rate``.
_RATES = np.geomspace(1.0, 1e6, 61)
# Number of bisections in the search for the critical rate.
_HALVINGS = 8
# Largest rate that the parameters of the law allow.
_LARGEST_RATE = 1e6
# Amplitudes of the target whose critical rates are compared, m.
_AMPLITUDES_M = (0.3, 1.0, 3.0)
# Times at which the drift is listed, s.
_DRIFT_S = (60.0, 600.0, 6000.0)
# The jam. Duration, s; simulated time after it, s; speed of the target, m/s; x of the
# wall, m; largest x that the control point P can reach, m.
_JAM_S, _AFTER_S, _JAM_SPEED_M_S, _WALL_M, _HELD_M = 90.0, 60.0, 0.15, 1.6, 1.0
# Coordinates of a wall that is absent, m.
_GONE_M = 1e9
# Rises of V below this share of V(0) count as rounding errors.
_ROUNDING = 1e-9
# Number of points of a plotted curve.
_DRAWN = 600


@dataclass(frozen=True)
class LyapunovRun:
    """Lyapunov function V over time in a run without contacts.

    The run begins with half of the desired gains.
    """

    time_s: NDArray[np.float64]
    """(n,) time, s."""
    continuous: NDArray[np.float64]
    """(n,) V/V(0) of the adaptation rule in continuous time."""
    sampled: NDArray[np.float64]
    """(n,) V/V(0) of the sampled loop with motor lag."""
    gains: NDArray[np.float64]
    """(n, 2) K, N/m, and D, N s/m, in continuous time."""
    wanted: tuple[float, float]
    """Desired gains: K = M w_n^2, N/m, and D = 2 xi w_n M, N s/m."""
    largest_rise: float
    """Largest rise of the continuous V over one control period, as a share of V(0)."""
    sampled_rise: float
    """Largest rise of the sampled V over one control period, as a share of V(0)."""

    @property
    def falls(self) -> bool:
        """Whether the continuous V never rises, except for rounding."""
        return self.largest_rise <= _ROUNDING


@dataclass(frozen=True)
class Drift:
    """Drift of K under a constant push that the reference model does not include."""

    push_n: float
    """Push F, N."""
    time_s: tuple[float, ...]
    """Times at which K is listed, s."""
    gradient_n_m: tuple[float, ...]
    """K by the closed form for the gradient rule without limits, N/m: see
    ``drift_stiffness``."""
    simulated_n_m: tuple[float, ...]
    """K in a simulation of the scenario's rule without limits of the gains, N/m."""
    limited_n_m: tuple[float, ...]
    """K in a simulation of the scenario's rule with its own limits, if any, N/m."""
    curve_s: NDArray[np.float64]
    """(n,) times of the curves, s."""
    curves_n_m: NDArray[np.float64]
    """(n, 2) curves of the two simulations: without limits, and as in the scenario,
    N/m."""


@dataclass(frozen=True)
class Jam:
    """Stiffness K while a wall holds the robot (a jam), and after the wall is removed.

    Each pair has the result without limits of the gains, and then the result with the
    limits of the scenario. A stiffness that has diverged is infinite.
    """

    jam_s: float
    """Duration of the jam, s."""
    after_s: float
    """Simulated time after the jam, s."""
    end_n_m: tuple[float, float]
    """K at the end of the jam, N/m."""
    left_n_m: tuple[float, float]
    """K at the end of the run, N/m."""


@dataclass(frozen=True)
class CriticalRate:
    """The least adaptation rate gamma_crit at which the gains or the motion diverge.

    The gains have no limits, and there are no contacts.
    """

    amplitude_m: float
    """Amplitude a of the target's position a (sin 0.6 t + 0.5 sin 1.7 t), m."""
    rate: float
    """gamma_crit, in the unit of ``AdaptationStability.rate``. Infinite if no allowed
    rate is critical."""

    @property
    def product(self) -> float:
        """gamma_crit a^2. In theory, this product does not depend on a."""
        return self.rate * self.amplitude_m**2


@dataclass(frozen=True)
class AdaptationStability:
    """Stability results for the adaptation rule of a scenario."""

    rule: str
    """Name of the rule."""
    rate: float
    """Adaptation rate gamma. Its unit is (N/m)^2 s^2/m^2 for the rule ``lyapunov``, and
    (N/m)^2/(m^2 s) for the rule ``sensitivity``."""
    reference: tuple[float, float]
    """Natural frequency w_n, rad/s, and damping ratio xi of the reference model."""
    reference_poles: NDArray[np.complex128]
    """(2,) poles of the continuous reference model in the s plane, rad/s."""
    held_poles: NDArray[np.complex128]
    """(2,) poles of the discrete reference model in the z plane."""
    lyapunov: LyapunovRun | None
    """Run with the Lyapunov function; None if the rule has no such function."""
    drift: Drift
    jam: Jam
    critical: CriticalRate
    """Critical rate for the amplitude ``pull_through_m``. If the target leads P by this
    distance, it pulls P through a contact."""
    products: tuple[CriticalRate, ...]
    """Critical rates for the amplitudes 0.3 m, 1 m and 3 m, to compare their
    products."""
    bounded: bool
    """Whether the rule limits K and D to a fixed range."""

    @property
    def margin(self) -> float:
        """gamma_crit/gamma. Above 1, gains and motion stay bounded in ``critical``."""
        return self.critical.rate / self.rate if self.rate else math.inf


def adaptation_stability(scenario: Scenario) -> AdaptationStability:
    """Analyzes whether a robot on a route is stable while its law adapts the gains.

    The results come from formulas, and from simulations of a point mass with motor lag.
    The function raises an InputError if the law does not adapt its gains.
    """
    own = route_law(scenario)
    if not isinstance(own, AdaptiveTrajectoryParameters):
        raise InputError(
            "law", f"{scenario.only.law!r} has no adaptation; use trajectory_adaptive"
        )
    mass, wanted = scenario.only.robot.mass_kg, (own.stiffness_n_m, own.damping_n_s_m)
    frequency, ratio = nominal_poles(mass, *wanted)
    loop = PointLoop(
        own,
        (frequency, ratio),
        scenario.only.robot,
        scenario.only.plant.motor_lag_s,
        scenario.tick_s,
    )
    amplitude = pull_through_m(own)
    rates = {a_m: critical_rate(loop, a_m) for a_m in {*_AMPLITUDES_M, amplitude}}
    a = np.array(held_matrices(frequency, ratio, scenario.tick_s).a).reshape(2, 2)
    line = [[0.0, 1.0], [-(frequency**2), -2.0 * ratio * frequency]]
    return AdaptationStability(
        rule=own.rule,
        rate=own.rate,
        reference=(frequency, ratio),
        reference_poles=np.linalg.eigvals(line).astype(complex),
        held_poles=np.linalg.eigvals(a).astype(complex),
        lyapunov=_lyapunov(loop, wanted) if own.rule == "lyapunov" else None,
        drift=_drift(loop),
        jam=_jam(loop),
        critical=rates[amplitude],
        products=tuple(rates[a_m] for a_m in _AMPLITUDES_M),
        bounded=own.projected,
    )


def swinging_target(
    amplitude_m: float, duration_s: float, tick_s: float
) -> NDArray[np.float64]:
    """Computes a target that oscillates along x: x = a (sin 0.6 t + 0.5 sin 1.7 t).

    a is ``amplitude_m``. With two frequencies, the adaptation can distinguish the
    stiffness K from the damping D. The result has the shape (ticks, 4): position (x,
    y), m, and velocity (x, y), m/s.
    """
    time = np.arange(0.0, duration_s, tick_s)
    targets = np.zeros((len(time), 4))
    targets[:, 0] = np.sin(0.6 * time) + 0.5 * np.sin(1.7 * time)
    targets[:, 2] = 0.6 * np.cos(0.6 * time) + 0.85 * np.cos(1.7 * time)
    return amplitude_m * targets


def critical_rate(loop: PointLoop, amplitude_m: float) -> CriticalRate:
    """Finds the least adaptation rate at which gains or motion diverge within 60 s.

    The gains have no limits. The target is that of ``swinging_target``. The function
    tries ten rates per decade, and then bisects the interval below the first rate with
    divergence. At some higher rates, there may again be no divergence. If no allowed
    rate leads to divergence, the rate in the result is infinite.
    """
    targets = swinging_target(amplitude_m, _CRITICAL_S, loop.tick_s)

    def runs_away(rate: float) -> bool:
        run = run_point(_unlimited(loop, rate), targets)
        found = np.concatenate([run.motion, run.gains], axis=1)
        return not bool(np.all(np.abs(found) < _WILD))

    rates = _RATES / amplitude_m**2
    low = 0.0
    for rate in rates[rates <= _LARGEST_RATE].tolist():
        if runs_away(rate):
            high = rate
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if runs_away(middle) else (middle, high)
            return CriticalRate(amplitude_m, high)
        low = rate
    return CriticalRate(amplitude_m, math.inf)


def drift_stiffness(start: float, rate: float, push: float, time_s: float) -> float:
    """Computes the stiffness K(t) of the gradient rule under a constant push, N/m.

    Under the push F, the robot rests at the distance F/K from its target. The
    sensitivity of its position p to K is dp/dK = -F/K^2. The gradient rule therefore
    gives K^3 dK/dt = gamma F^2.

    ``start`` is K at the time 0, N/m. ``rate`` is gamma, (N/m)^2/(m^2 s). ``push`` is
    F, N.
    """
    return float((start**4 + 4.0 * rate * push**2 * time_s) ** 0.25)


def _unlimited(loop: PointLoop, rate: float | None = None) -> PointLoop:
    """Returns a copy in which only K and D adapt, without limits and safety term.

    ``rate`` replaces the adaptation rate of K and D.
    """
    plain = {"projected": False, "penalty": 0.0, "contact_rate": 0.0}
    rates = {} if rate is None else {"rate": rate}
    return loop._replace(law=loop.law.model_copy(update={**plain, **rates}))


def _lyapunov(loop: PointLoop, wanted: tuple[float, float]) -> LyapunovRun:
    """Simulates the continuous and the sampled loop from half of the desired gains."""
    mass, rate = loop.robot.mass_kg, loop.law.rate
    assert loop.poles is not None
    frequency, ratio = loop.poles
    time = np.arange(0.0, _LEARN_S, loop.tick_s)
    targets = swinging_target(1.0, _LEARN_S, loop.tick_s)
    start = [_OFF * wanted[0], _OFF * wanted[1]]

    def slope(t: float, x: NDArray[np.float64]) -> list[float]:
        p, v, p_r, v_r, stiffness, damping = x
        p_d = math.sin(0.6 * t) + 0.5 * math.sin(1.7 * t)
        v_d = 0.6 * math.cos(0.6 * t) + 0.85 * math.cos(1.7 * t)
        at = p_d, 0.0, v_d, 0.0
        force = target_force((p, 0.0), (v, 0.0), at, stiffness, damping)[0]
        source = sensitivity_sources((p, 0.0), (v, 0.0), at, [], mass)
        a_r = frequency**2 * (p_d - p_r) + 2.0 * ratio * frequency * (v_d - v_r)
        learned = -rate * (v - v_r)
        grown = learned * source.stiffness[0], learned * source.damping[0]
        return [v, force / mass, v_r, a_r, *grown]

    begin = [0.0, targets[0, 2], 0.0, targets[0, 2], *start]
    found = solve_ivp(
        slope,
        (0.0, float(time[-1])),
        begin,
        t_eval=time,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.2,
    ).y.T
    gains = loop.law.model_copy(
        update={"stiffness_n_m": start[0], "damping_n_s_m": start[1]}
    )
    run = run_point(_unlimited(loop._replace(law=gains)), targets)
    continuous = _energy(found[:, :4], found[:, 4:], wanted, frequency, rate)
    moved = np.column_stack(
        [run.motion[:, [0, 2]], run.reference[:, [0, 2]], run.gains[:, :2]]
    )
    sampled = _energy(moved[:, :4], moved[:, 4:], wanted, frequency, rate)
    return LyapunovRun(
        time_s=time,
        continuous=continuous / continuous[0],
        sampled=sampled / sampled[0],
        gains=found[:, 4:],
        wanted=wanted,
        largest_rise=float(max(np.diff(continuous).max(), 0.0) / continuous[0]),
        sampled_rise=float(max(np.diff(sampled).max(), 0.0) / sampled[0]),
    )


def _energy(
    motion: NDArray[np.float64],
    gains: NDArray[np.float64],
    wanted: tuple[float, float],
    frequency: float,
    rate: float,
) -> NDArray[np.float64]:
    """Computes V = w_n^2 e^2/2 + e_v^2/2 + ((K - K*)^2 + (D - D*)^2)/(2 gamma).

    e and e_v are the deviations of position and velocity from the reference. K* and D*
    are the desired gains.
    """
    p, v, p_r, v_r = motion.T
    off = ((gains - np.array(wanted)) ** 2).sum(axis=1)
    square = frequency**2 * (p - p_r) ** 2 + (v - v_r) ** 2
    return np.asarray(0.5 * square + off / (2.0 * rate))


def _drift(loop: PointLoop) -> Drift:
    own, rate = loop.law, loop.law.rate
    push = 0.5 * own.contact_stiffness_n_m * own.security_zone_m or 1.0
    ticks = [round(t / loop.tick_s) for t in _DRIFT_S]
    targets = np.zeros((ticks[-1], 4))
    start = (push / own.stiffness_n_m, 0.0, 0.0, 0.0)
    curves = np.stack(
        [
            run_point(each, targets, start=start, push=(push, 0.0)).gains[:, 0]
            for each in (_unlimited(loop), loop)
        ],
        axis=1,
    )
    at = [tick - 1 for tick in ticks]
    drawn = np.unique(np.geomspace(1, len(curves) - 1, _DRAWN).astype(int))
    return Drift(
        push_n=push,
        time_s=_DRIFT_S,
        gradient_n_m=tuple(
            drift_stiffness(own.stiffness_n_m, rate, push, t) for t in _DRIFT_S
        ),
        simulated_n_m=tuple(curves[at, 0].tolist()),
        limited_n_m=tuple(curves[at, 1].tolist()),
        curve_s=drawn * loop.tick_s,
        curves_n_m=curves[drawn],
    )


def _jam(loop: PointLoop) -> Jam:
    """Simulates a jam. The target moves on during the jam, and stops at its end."""
    time = np.arange(0.0, _JAM_S + _AFTER_S, loop.tick_s)
    jammed = time < _JAM_S
    targets = np.zeros((len(time), 4))
    targets[:, 0] = _JAM_SPEED_M_S * np.minimum(time, _JAM_S)
    targets[jammed, 2] = _JAM_SPEED_M_S
    wall = np.full((len(time), 1, 4), _GONE_M)
    wall[jammed, 0] = _WALL_M, 0.0, 0.0, 0.0
    held = np.where(jammed, _HELD_M, math.inf)
    runs = [
        run_point(each, targets, wall, held=held).gains[:, 0]
        for each in (_unlimited(loop), loop)
    ]
    last = int(np.flatnonzero(jammed)[-1])
    found = [[float(run[at]) for run in runs] for at in (last, -1)]
    # A gain that has run away may not be a finite number.
    ends, left = ([k if abs(k) < _WILD else math.inf for k in row] for row in found)
    return Jam(_JAM_S, _AFTER_S, (ends[0], ends[1]), (left[0], left[1]))
