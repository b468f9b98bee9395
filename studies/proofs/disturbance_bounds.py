"""Bounds for a moving source and for a moving obstacle, in the point-mass model.

The robot is a mass M at its control point p, with velocity v. K_r and D_r are stiffness
and damping of the attraction to the source at p_S. d_f is the follow distance.

**Source.** Let x = |p - p_S| - d_f be the stretch, w = v - v_S the relative velocity,
and n the unit vector from the source to p. The Lyapunov function is

    W = M |w|^2 / 2 + K_r x^2 / 2 + e M x (n . w)

With z = (|x|, |w|), W decreases wherever

    z' Q z > d (|w| + e |x|),   d = D_r |v_S| + M |a_S|

The stretch is therefore input-to-state stable and ultimately bounded. The rotation of n
adds at most e M |w_t|^2. The bound requires e |x| <= v_max - |v_S|. The clamp of |v| to
v_max then does not increase W.

**Obstacle.** The obstacle moves at v_O, and the axes move with the obstacle. The
velocity term of the law injects at most L |v|^2
(``analysis.energy.velocity_passivity``). The energy V then obeys

    V' <= sqrt(2 K_r V) v_O + D_r^2 v_O^2 / (4 (D_r - L))

as long as v_O <= v_max. An encounter is certified up to the time at which V may reach
U(contact), the energy of the repulsion at contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.energy.velocity_passivity import velocity_term_passivity
from analysis.loops.point_mass import PointMass, point_mass
from diagrams import Scenario
from systems.world.geometry import beyond_each

#: Speeds of the tables, m/s.
SPEEDS_M_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
# Step, and length of the runs behind a source, s.
_STEP_S, _FOLLOW_S = 0.02, 60.0
# Side of the square obstacle in the encounters, m.
_SIDE_M = 0.1


@dataclass(frozen=True)
class SourceBound:
    """Bounds of the stretch x while the robot follows a source.

    The stretch is the distance from the source to the robot's control point minus the
    follow distance.
    """

    speed_m_s: float
    """Largest speed |v_S| of the source, m/s."""
    acceleration_m_s2: float
    """Largest acceleration |a_S| of the source, m/s^2."""
    bound_m: float | None
    """Proved bound of the stretch |x|, m; None if no bound can be proved.

    The robot starts at rest at the follow distance.
    """
    steady_m: float
    """Stretch D_r v_S / K_r at constant speed, m."""
    linear_peak_m: float
    """Largest |x| along a line for any force up to d, without the speed clamp, m."""
    simulated_m: float | None
    """Largest simulated stretch |x| after the source starts at constant speed, m.

    None means that the robot cannot keep up with the source.
    """


@dataclass(frozen=True)
class ObstacleBound:
    """Bound for an obstacle that moves toward a robot at rest at its follow point."""

    speed_m_s: float
    """Speed v_O of the obstacle, m/s."""
    certified_s: float
    """Time without contact after the obstacle comes within reach, s."""
    encounter_s: float
    """Time that the obstacle takes to pass through the reach, s."""
    simulated_contact_s: float | None
    """Earliest contact in the simulated encounters, s; None without contact."""
    runs: int
    """Number of simulated encounters."""

    @property
    def certified(self) -> bool:
        """Whether the whole encounter is certified."""
        return self.certified_s >= self.encounter_s


@dataclass(frozen=True)
class DisturbanceBounds:
    """Bounds for a moving source and for a moving obstacle."""

    law: str
    """Name of the scenario's law."""
    source: tuple[SourceBound, ...]
    """Two rows per speed: along a straight line, and in the scenario's corners."""
    obstacle: tuple[ObstacleBound, ...]
    """One row per speed; empty if the velocity term uses up all of D_r."""

    def to_dict(self) -> dict[str, Any]:
        """Converts the bounds to plain values for the JSON document."""
        rows = [vars(row) | {"certified": row.certified} for row in self.obstacle]
        return vars(self) | {"obstacle": rows}


def disturbance_bounds(scenario: Scenario, *, runs: int = 200) -> DisturbanceBounds:
    """Computes bounds for a moving source and a moving obstacle, and simulates both.

    Args:
        scenario: Scenario with the gains, the law and the source's corner radius.
        runs: Number of simulated encounters with an obstacle per speed.

    Returns:
        Bounds and simulation results, for several speeds below the top speed.

    Raises:
        InputError: The law is not known.
        ValueError: The law has no radial force.
    """
    model = point_mass(scenario)
    top = model.top_speed_m_s
    speeds = [v for v in SPEEDS_M_S if v < top]
    radius = scenario.source.corner_radius_m
    rows = []
    for speed in speeds:
        rows.append(source_bound(model, speed))
        rows.append(source_bound(model, speed, speed**2 / radius, simulate=False))
    rng = np.random.default_rng(scenario.seed)
    injection = velocity_term_passivity(scenario).largest_injection_n_s_m
    spare = model.damping_n_s_m - injection
    contact = scenario.follower.ultrasonic.minimum_range_m
    obstacle = [
        _obstacle_bound(model, speed, spare, contact, rng, runs)
        for speed in (speeds if spare > 0.0 else ())
    ]
    return DisturbanceBounds(model.law.name, tuple(rows), tuple(obstacle))


def source_bound(
    model: PointMass,
    speed: float,
    acceleration: float = 0.0,
    *,
    simulate: bool = True,
) -> SourceBound:
    """Computes a bound of the stretch while the robot follows a source.

    The stretch is the distance to the source minus the follow distance. The bound uses
    the best weight e from a list (see the module docstring).

    Args:
        model: Point-mass model with the gains.
        speed: Largest speed |v_S| of the source, m/s.
        acceleration: Largest acceleration |a_S| of the source, m/s^2.
        simulate: Whether to simulate a source at constant speed, too.

    Returns:
        Bounds and simulated peak of the stretch, m.
    """
    disturbance = model.damping_n_s_m * speed + model.mass_kg * acceleration
    bounds = [
        _ultimate_bound(model, speed, disturbance, share * _largest_weight(model))
        for share in np.linspace(0.02, 0.98, 97)
    ]
    best = min(bounds)
    return SourceBound(
        speed_m_s=speed,
        acceleration_m_s2=acceleration,
        bound_m=best if math.isfinite(best) else None,
        steady_m=model.damping_n_s_m * speed / model.stiffness_n_m,
        linear_peak_m=disturbance * _peak_gain(model),
        simulated_m=_simulated_stretch(model, speed) if simulate else None,
    )


def _largest_weight(model: PointMass) -> float:
    """Largest weight e for which W and its decrease are positive definite."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    # (D - e M) e K > (e D / 2)^2, and e^2 M < K.
    return min(D * K / (M * K + 0.25 * D * D), math.sqrt(K / M))


def _ultimate_bound(model: PointMass, speed: float, d: float, e: float) -> float:
    """Bound of |x| from rest at the follow point, m; inf if e proves no bound."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    Q = np.array([[e * K, -0.5 * e * D], [-0.5 * e * D, D - e * M]])
    b = d * np.array([e, 1.0])
    # z' Q z = b' z is an ellipse through 0 with center Q^-1 b / 2. W is largest on it.
    center = 0.5 * np.linalg.solve(Q, b)
    radius = math.sqrt(max(float(center @ Q @ center), 0.0))
    root = np.linalg.cholesky(np.linalg.inv(Q))
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = center[:, None] + radius * root @ np.array([np.cos(angle), np.sin(angle)])
    # Chords between neighboring points shorten the ellipse by at most this factor.
    x, w = np.maximum(ring, 0.0) / math.cos(math.pi / 720.0)
    level = float(np.max(0.5 * K * x**2 + 0.5 * M * w**2 + e * M * x * w))
    level = max(level, 0.5 * M * speed**2)
    bound = math.sqrt(2.0 * level / (K - e * e * M))
    return bound if e * bound <= model.top_speed_m_s - speed else math.inf


def _peak_gain(model: PointMass) -> float:
    """Integral of |impulse response| of 1/(M s^2 + D_r s + K_r) over time, m/N."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    ratio = D / (2.0 * math.sqrt(K * M))
    if ratio >= 1.0:
        return 1.0 / K
    turn = math.pi * ratio / math.sqrt(1.0 - ratio * ratio)
    return 1.0 / (K * math.tanh(0.5 * turn))


def _simulated_stretch(model: PointMass, speed: float) -> float | None:
    """Largest |x| in a run behind a source that starts to move, without obstacles."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    x = v = largest = 0.0
    for _ in range(round(_FOLLOW_S / _STEP_S)):
        v += _STEP_S * (K * x - D * v) / M
        v = max(-model.top_speed_m_s, min(v, model.top_speed_m_s))
        x += _STEP_S * (speed - v)
        largest = max(largest, abs(x))
    return largest if abs(v - speed) < 0.05 * speed else None


def _obstacle_bound(
    model: PointMass,
    speed: float,
    spare: float,
    contact: float,
    rng: np.random.Generator,
    runs: int,
) -> ObstacleBound:
    reach = _reach(model)
    encounter = 2.0 * reach / speed
    times = encounter_contact_time(
        model, speed, contact, rng.uniform(-0.3, 0.3, runs), reach, encounter
    )
    first = float(times.min())
    return ObstacleBound(
        speed_m_s=speed,
        certified_s=_certified_time(model, speed, spare, contact),
        encounter_s=encounter,
        simulated_contact_s=first if math.isfinite(first) else None,
        runs=runs,
    )


def _reach(model: PointMass) -> float:
    """Distance up to which the repulsion at rest has over 1 % of its energy, m."""
    energies = model.law.energies_j
    far = np.flatnonzero(energies > 0.01 * energies[0])
    return float(model.law.distances_m[far[-1]]) if len(far) else model.law.range_m


def _certified_time(
    model: PointMass, speed: float, spare: float, contact: float
) -> float:
    """Time for which V stays below U(contact), from rest at the follow point, s."""
    barrier = float(model.law.energy(contact))
    K, D = model.stiffness_n_m, model.damping_n_s_m
    start = 0.5 * model.mass_kg * speed**2 + float(model.law.energy(_reach(model)))
    if start >= barrier:
        return 0.0
    # Integrates the time with V' at its bound, by the midpoint rule over sqrt(V).
    y = np.linspace(math.sqrt(start), math.sqrt(barrier), 4001)
    middle = 0.5 * (y[1:] + y[:-1])
    rate = math.sqrt(0.5 * K) * speed + D * D * speed**2 / (8.0 * spare * middle)
    return float(np.sum(np.diff(y) / rate))


def encounter_contact_time(
    model: PointMass,
    speed: float,
    contact_m: float,
    offsets_m: NDArray[np.float64],
    reach_m: float,
    duration_s: float,
) -> NDArray[np.float64]:
    """Simulates boxes that approach a robot, and returns the times of contact.

    The robot's control point P starts at rest at the follow distance from the source,
    which is behind the robot. The box moves toward P at constant speed. The path of the
    box passes P at the given lateral offset.

    Args:
        model: Point-mass model with the gains and the law. The law's force is that at
            rest.
        speed: Speed of the box, m/s.
        contact_m: Distance from P to the box that counts as contact, m.
        offsets_m: (n,) lateral offsets of the box's path from P, m.
        reach_m: Distance of the box from P at the start, m.
        duration_s: Simulated time, s.

    Returns:
        (n,) times of contact since the start, s; infinite without contact.
    """
    count = len(offsets_m)
    p = np.zeros((count, 2))
    v = np.zeros((count, 2))
    p_S = np.array([-max(model.follow_distance_m, 1e-3), 0.0])
    box = np.column_stack([np.full(count, reach_m + 0.5 * _SIDE_M), offsets_m])
    times = np.full(count, np.inf)
    for k in range(round(duration_s / _STEP_S)):
        gap = box - p
        nearest = beyond_each(gap, 0.5 * _SIDE_M)
        c = np.hypot(*nearest.T)
        times = np.where((c <= contact_m) & np.isinf(times), k * _STEP_S, times)
        f = model.law.at_rest(c)
        away = -nearest / np.maximum(c, 1e-9)[:, None]
        to_S = p_S - p
        r = np.maximum(np.hypot(*to_S.T), 1e-9)
        pull = model.stiffness_n_m * (1.0 - model.follow_distance_m / r)
        force = pull[:, None] * to_S - model.damping_n_s_m * v + f[:, None] * away
        v = v + _STEP_S * force / model.mass_kg
        fast = np.maximum(np.hypot(*v.T) / model.top_speed_m_s, 1.0)
        v = v / fast[:, None]
        p = p + _STEP_S * v
        box[:, 0] -= _STEP_S * speed
    return times
