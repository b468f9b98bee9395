"""Whether gains that adapt stay bounded: Lyapunov function, drift, jam, rates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from analysis.trajectory.point_run import PointLoop, run_point
from analysis.trajectory.route_loop import route_law
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError
from systems.laws.trajectory.impedance_sensitivity import sensitivity_sources
from systems.laws.trajectory.reference_model import held_matrices, nominal_poles
from systems.laws.trajectory.sampled_bounds import pull_through_m
from systems.laws.trajectory.trajectory_adaptive import AdaptiveTrajectoryParameters
from systems.laws.trajectory.trajectory_impedance import target_force

#: Length of a run that learns, and of one that looks for a critical rate, s.
_LEARN_S, _CRITICAL_S = 60.0, 60.0
#: Gains that the learning starts from, of the wanted ones.
_OFF = 0.5
#: A motion, m, or a gain beyond this runs away.
_WILD = 1e4
#: Rates that are tried, (N/m)^2/(m^2 s) at 1 m, ten a decade.
_RATES = np.geomspace(1.0, 1e6, 61)
_HALVINGS = 8
#: Largest rate that the parameters take.
_LARGEST_RATE = 1e6
#: Amplitudes whose critical rates are compared, m.
_AMPLITUDES_M = (0.3, 1.0, 3.0)
#: When the drift is read, s.
_DRIFT_S = (60.0, 600.0, 6000.0)
#: The jam: how long, how long after it, s, the target's speed, m/s, the wall and where
#: it holds P, m.
_JAM_S, _AFTER_S, _JAM_SPEED_M_S, _WALL_M, _HELD_M = 90.0, 60.0, 0.15, 1.6, 1.0
#: A wall there is none, m.
_GONE_M = 1e9
#: Rises of V below this share of its start are rounding.
_ROUNDING = 1e-9
#: Points of a curve that is drawn.
_DRAWN = 600


@dataclass(frozen=True)
class LyapunovRun:
    """V over a run without contacts whose gains start off, and the gains."""

    time_s: NDArray[np.float64]
    """(n,) s."""
    continuous: NDArray[np.float64]
    """(n,) V/V(0) of the rule in continuous time."""
    sampled: NDArray[np.float64]
    """(n,) the same of the sampled loop with its motors."""
    gains: NDArray[np.float64]
    """(n, 2) K, N/m, and D, N s/m, in continuous time."""
    wanted: tuple[float, float]
    """M w_n^2 and 2 xi w_n M."""
    largest_rise: float
    """Of the continuous V between two instants, of V(0)."""
    sampled_rise: float
    """The same of the sampled one between two ticks."""

    @property
    def falls(self) -> bool:
        """Whether V never rises, to rounding."""
        return self.largest_rise <= _ROUNDING


@dataclass(frozen=True)
class Drift:
    """K under a constant push that the reference does not know."""

    push_n: float
    """F, N."""
    time_s: tuple[float, ...]
    gradient_n_m: tuple[float, ...]
    """(K_0^4 + 4 gamma F^2 t)^(1/4), the gradient's without limits, N/m."""
    simulated_n_m: tuple[float, ...]
    """This rule without limits of the gains, N/m."""
    limited_n_m: tuple[float, ...]
    """This rule as the scenario has it, N/m."""
    curve_s: NDArray[np.float64]
    """(n,) s."""
    curves_n_m: NDArray[np.float64]
    """(n, 2) K without limits, and as the scenario has it, N/m."""


@dataclass(frozen=True)
class Jam:
    """K behind a wall that P cannot pass while the target goes on; then it is gone."""

    jam_s: float
    after_s: float
    end_n_m: tuple[float, float]
    """K at the end of the jam without limits, and as the scenario has it, N/m."""
    left_n_m: tuple[float, float]
    """The same so long after; infinite: it has run away."""


@dataclass(frozen=True)
class CriticalRate:
    """The rate from which K and D run away, without limits and without contacts."""

    amplitude_m: float
    """a of the target a (sin 0.6 t + 0.5 sin 1.7 t)."""
    rate: float
    """gamma_crit, (N/m)^2/(m^2 s); infinite where none that is allowed is."""

    @property
    def product(self) -> float:
        """gamma_crit a^2, which does not depend on a."""
        return self.rate * self.amplitude_m**2


@dataclass(frozen=True)
class AdaptationStability:
    """All of it for the rule of a scenario."""

    rule: str
    rate: float
    """gamma, (N/m)^2/(m^2 s)."""
    reference: tuple[float, float]
    """w_n, rad/s, and xi."""
    reference_poles: NDArray[np.complex128]
    """(2,) s plane, rad/s."""
    held_poles: NDArray[np.complex128]
    """(2,) of the block, z plane."""
    lyapunov: LyapunovRun | None
    """None for a rule that has no such function."""
    drift: Drift
    jam: Jam
    critical: CriticalRate
    """At the lag at which the target pulls P through a contact, or 1 m."""
    products: tuple[CriticalRate, ...]
    """At other amplitudes."""
    bounded: bool
    """Whether limits hold K and D whatever happens."""

    @property
    def margin(self) -> float:
        """gamma_crit/gamma; above 1 it is stable."""
        return self.critical.rate / self.rate if self.rate else math.inf


def adaptation_stability(scenario: Scenario) -> AdaptationStability:
    """Stability of the adaptation of a robot on a route.

    Args:
        scenario: Its law adapts.

    Returns:
        By simulation of a point with the motors' lag, and by closed forms.

    Raises:
        InputError: The law does not adapt.
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
    """a (sin 0.6 t + 0.5 sin 1.7 t) along x: two frequencies tell K and D apart.

    Args:
        amplitude_m: a, m.
        duration_s: s.
        tick_s: s.

    Returns:
        (ticks, 4) p_d and v_d, m and m/s.
    """
    time = np.arange(0.0, duration_s, tick_s)
    targets = np.zeros((len(time), 4))
    targets[:, 0] = np.sin(0.6 * time) + 0.5 * np.sin(1.7 * time)
    targets[:, 2] = 0.6 * np.cos(0.6 * time) + 0.85 * np.cos(1.7 * time)
    return amplitude_m * targets


def critical_rate(loop: PointLoop, amplitude_m: float) -> CriticalRate:
    """The least rate at which the rule, without limits, runs away within a minute.

    Args:
        loop: Its rule, gains, reference, mass, lag and tick are used.
        amplitude_m: Of the target, m.

    Returns:
        To 2 %; rates in which it runs away are no interval, and this is the first.
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
    """K(t) of the gradient under a constant push: K^3 K' = gamma F^2 at rest.

    Args:
        start: K_0, N/m.
        rate: gamma, (N/m)^2/(m^2 s).
        push: F, N.
        time_s: t, s.

    Returns:
        N/m: P is off by F/K, and dp/dK is -F/K^2.
    """
    return float((start**4 + 4.0 * rate * push**2 * time_s) ** 0.25)


def _unlimited(loop: PointLoop, rate: float | None = None) -> PointLoop:
    """The same rule of K and D without limits and without the safety term."""
    plain = {"projected": False, "penalty": 0.0, "contact_rate": 0.0}
    rates = {} if rate is None else {"rate": rate}
    return loop._replace(law=loop.law.model_copy(update={**plain, **rates}))


def _lyapunov(loop: PointLoop, wanted: tuple[float, float]) -> LyapunovRun:
    """Both loops from gains that are off, at the scenario's rate."""
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
        learnt = -rate * (v - v_r)
        grown = learnt * source.stiffness[0], learnt * source.damping[0]
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
    """V = w_n^2 e^2/2 + e_v^2/2 + ((K - K*)^2 + (D - D*)^2)/(2 gamma)."""
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
    """The target goes on for the jam's length, and then stays where it is."""
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
    # What has run away is no number any more.
    ends, left = ([k if abs(k) < _WILD else math.inf for k in row] for row in found)
    return Jam(_JAM_S, _AFTER_S, (ends[0], ends[1]), (left[0], left[1]))
