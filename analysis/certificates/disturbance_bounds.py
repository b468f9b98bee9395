"""Bounds for a moving source and a moving obstacle, in the point-mass model.

**Source.** With stretch x = |p - p_S| - d_f, relative velocity w = v - v_S and n
from the source to P,

    W = M |w|^2 / 2 + K_r x^2 / 2 + e M x (n . w)

falls wherever z' Q z > d (|w| + e |x|), z = (|x|, |w|), with d = D_r |v_S| + M
|a_S|: input-to-state stability, and an ultimate bound of x. The turning of n adds
at most e M |w_t|^2. The clamp on |v| only helps while e |x| <= v_max - |v_S|.

**Obstacle.** In the axes of an obstacle that moves at v_O, with L the velocity
term's injection (``analysis.nonlinear.velocity_passivity``), the energy V obeys

    V' <= sqrt(2 K_r V) v_O + D_r^2 v_O^2 / (4 (D_r - L))

as long as v_O <= v_max. An encounter is certified until V may reach U(contact).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models.point_mass import PointMass, point_mass
from analysis.nonlinear.velocity_passivity import velocity_term_passivity
from diagrams import Scenario
from systems.world.geometry import beyond_each

#: Speeds of the tables, m/s.
SPEEDS_M_S = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
#: Step and length of the simulated runs, s.
_STEP_S, _FOLLOW_S = 0.02, 60.0
#: Side of the obstacle of the encounters, m.
_SIDE_M = 0.1


@dataclass(frozen=True)
class SourceBound:
    """Following a source of bounded speed and acceleration."""

    speed_m_s: float
    """Largest |v_S|, m/s."""
    acceleration_m_s2: float
    """Largest |a_S|, m/s^2."""
    bound_m: float | None
    """|x| from rest at the follow point on, m; none: no W of this form bounds it."""
    steady_m: float
    """D_r v_S / K_r: the offset at constant speed, m."""
    linear_peak_m: float
    """Largest |x| along a line for any force up to d, without the clamp, m."""
    simulated_m: float | None
    """Largest |x| after a source that moves off at constant speed, m; none:
    the robot cannot keep up."""


@dataclass(frozen=True)
class ObstacleBound:
    """An obstacle that comes at a robot resting at its follow point."""

    speed_m_s: float
    """v_O, m/s."""
    certified_s: float
    """No contact for so long after it comes within reach, s."""
    encounter_s: float
    """What it takes to pass through the reach, s."""
    simulated_contact_s: float | None
    """Earliest contact of the simulated encounters, s; none: no contact."""
    runs: int
    """Simulated encounters."""

    @property
    def certified(self) -> bool:
        """Whether the whole encounter is."""
        return self.certified_s >= self.encounter_s


@dataclass(frozen=True)
class DisturbanceBounds:
    """Both tables."""

    law: str
    """The scenario's law."""
    source: tuple[SourceBound, ...]
    """By speed, straight and through the scenario's corners."""
    obstacle: tuple[ObstacleBound, ...]
    """By speed; empty where the velocity term takes all of D_r."""

    def to_dict(self) -> dict[str, Any]:
        """For the JSON document."""
        rows = [vars(row) | {"certified": row.certified} for row in self.obstacle]
        return vars(self) | {"obstacle": rows}


def disturbance_bounds(scenario: Scenario, *, runs: int = 200) -> DisturbanceBounds:
    """Bounds beside simulation.

    Args:
        scenario: Gains, law and the source's corner radius.
        runs: Simulated encounters a speed.

    Returns:
        A row a speed below the top speed, for the source and for the obstacle.

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
    """The bound of the stretch, by the best weight e of a list.

    Args:
        model: Gains.
        speed: Largest |v_S|, m/s.
        acceleration: Largest |a_S|, m/s^2.
        simulate: Whether to add a run at constant speed.

    Returns:
        Bound, offsets and peaks of the stretch, m.
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
    """Below it both W and its decrease are definite."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    # (D - e M) e K > (e D / 2)^2, and e^2 M < K.
    return min(D * K / (M * K + 0.25 * D * D), math.sqrt(K / M))


def _ultimate_bound(model: PointMass, speed: float, d: float, e: float) -> float:
    """Bound of |x| from rest at the follow point on, m; infinite: e proves none."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    Q = np.array([[e * K, -0.5 * e * D], [-0.5 * e * D, D - e * M]])
    b = d * np.array([e, 1.0])
    # z' Q z = b' z is an ellipse about Q^-1 b / 2 through 0; W is greatest on it.
    centre = 0.5 * np.linalg.solve(Q, b)
    radius = math.sqrt(max(float(centre @ Q @ centre), 0.0))
    root = np.linalg.cholesky(np.linalg.inv(Q))
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = centre[:, None] + radius * root @ np.array([np.cos(angle), np.sin(angle)])
    # Chords between neighbours cut the ellipse short by at most this factor.
    x, w = np.maximum(ring, 0.0) / math.cos(math.pi / 720.0)
    level = float(np.max(0.5 * K * x**2 + 0.5 * M * w**2 + e * M * x * w))
    level = max(level, 0.5 * M * speed**2)
    bound = math.sqrt(2.0 * level / (K - e * e * M))
    return bound if e * bound <= model.top_speed_m_s - speed else math.inf


def _peak_gain(model: PointMass) -> float:
    """Integral of |impulse response| of 1/(M s^2 + D_r s + K_r), m/N."""
    M, K, D = model.mass_kg, model.stiffness_n_m, model.damping_n_s_m
    ratio = D / (2.0 * math.sqrt(K * M))
    if ratio >= 1.0:
        return 1.0 / K
    turn = math.pi * ratio / math.sqrt(1.0 - ratio * ratio)
    return 1.0 / (K * math.tanh(0.5 * turn))


def _simulated_stretch(model: PointMass, speed: float) -> float | None:
    """Largest |x| of a run behind a source that moves off, without obstacles."""
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
    """Distance beyond which the repulsion at rest has 1 % of its energy left, m."""
    energies = model.law.energies_j
    far = np.flatnonzero(energies > 0.01 * energies[0])
    return float(model.law.distances_m[far[-1]]) if len(far) else model.law.range_m


def _certified_time(
    model: PointMass, speed: float, spare: float, contact: float
) -> float:
    """How long V, from rest at the follow point, stays below U(contact), s."""
    barrier = float(model.law.energy(contact))
    K, D = model.stiffness_n_m, model.damping_n_s_m
    start = 0.5 * model.mass_kg * speed**2 + float(model.law.energy(_reach(model)))
    if start >= barrier:
        return 0.0
    # Time along V' = its bound, by the midpoint rule over sqrt(V).
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
    """Times of contact with a box that comes from ahead.

    P rests at its follow point, the source behind it; the box moves towards P
    and on, its centre off the line by the given distances.

    Args:
        model: Gains and law; s is left out.
        speed: Of the box, m/s.
        contact_m: P nearer to the box is contact, m.
        offsets_m: (n,) distances of the box's path from P, m.
        reach_m: Distance of the box from P at the start, m.
        duration_s: Simulated time, s.

    Returns:
        (n,) s from the start; infinity: none.
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
