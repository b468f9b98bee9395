"""Compiled loops of the point-mass model of ``analysis.loops.point_mass``.

A world has four parts:

- bodies: (k, 7) rows x, y, cosine and sine of the heading, half length, half width,
  radius
- position of the source: (2,) in the world frame W, m
- gains: stiffness K_r, damping D_r, follow distance d_f, mass M, top speed, whether all
  bodies push (0 or 1), and velocity term (0: none, 1: printed, 2: closing)
- tables of ``RadialLaw``: forces, energies, increments
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from analysis.loops.radial_law import DISTANCE_STEP_M, INCREMENT_STEPS
from systems.framework.compiling import njit
from systems.world.geometry import beyond

_Array = NDArray[np.float64]
_State = tuple[float, float, float, float]
_Vector = tuple[float, float, float, float]
_Gains = tuple[float, ...]
_Tables = tuple[_Array, _Array, _Array]
_World = tuple[_Array, _Array, _Gains, _Tables]

#: If the nearest body changes in an integration step, the step is repeated in this
#: number of parts.
_SWITCH_PARTS = 32


@njit(cache=True)
def _nearest(
    x: float, y: float, body: _Array
) -> _Vector:  # pragma: no cover  (compiled)
    """Vector from (x, y) to the nearest point of a body, in W, m.

    The four values are x and y of the vector, its length, and the rate at which the
    vector changes if (x, y) moves across it at 1 m/s. The rate is 0 before an edge and
    1 before a sharp corner.
    """
    dx, dy = x - body[0], y - body[1]
    u, v = body[2] * dx + body[3] * dy, -body[3] * dx + body[2] * dy
    du, dv = -beyond(u, body[4]), -beyond(v, body[5])
    corner = du != 0.0 and dv != 0.0
    if body[6] > 0.0:
        far = math.sqrt(du * du + dv * dv)
        share = max(1.0 - body[6] / max(far, 1e-12), 0.0)
        # Before a disc, both components of the vector may vanish.
        corner = corner or (body[4] == 0.0 and body[5] == 0.0)
        du, dv = share * du, share * dv
    else:
        share = 1.0
    cx, cy = body[2] * du - body[3] * dv, body[3] * du + body[2] * dv
    return cx, cy, math.sqrt(cx * cx + cy * cy), share if corner else 0.0


@njit(cache=True)
def _lookup(table: _Array, c: float) -> float:  # pragma: no cover  (compiled)
    """Interpolates a table linearly; beyond the table the value is 0."""
    place = c / DISTANCE_STEP_M
    index = int(place)
    if index >= table.shape[0] - 1:
        return 0.0
    part = place - index
    return (1.0 - part) * table[index] + part * table[index + 1]


@njit(cache=True)
def _increment(
    table: _Array, c: float, s: float
) -> float:  # pragma: no cover  (compiled)
    """f(c, s) - f(c, 0), N: row of the nearest c in the table, interpolated over s."""
    row = int(c / INCREMENT_STEPS[0] + 0.5)
    if row >= table.shape[0]:
        return 0.0
    place = s / INCREMENT_STEPS[1]
    column = min(int(place), table.shape[1] - 2)
    part = place - column
    return (1.0 - part) * table[row, column] + part * table[row, column + 1]


@njit(cache=True)
def _radial_force(
    vector: _Vector, v_WP: tuple[float, float], term: float, tables: _Tables
) -> float:  # pragma: no cover
    """Force f(c, s) of the law, N, away from a body at rest.

    ``vector`` is that of ``_nearest``. ``term`` selects the speed s: 0, |dC/dt| or the
    speed of approach.
    """
    cx, cy, c, across = vector
    vx, vy = v_WP
    f = _lookup(tables[0], c)
    if term > 0.5:
        toward = (vx * cx + vy * cy) / max(c, 1e-12)
        if term > 1.5:
            s = max(0.0, toward)
        elif across == 1.0:
            s = math.sqrt(vx * vx + vy * vy)
        elif across > 0.0:
            aside = across * (vx * cy - vy * cx) / max(c, 1e-12)
            s = math.sqrt(toward * toward + aside * aside)
        else:
            s = abs(toward)
        f += _increment(tables[2], c, s)
    return f


@njit(cache=True)
def _force(
    state: _State, world: _World
) -> tuple[float, float, float, float, int]:  # pragma: no cover
    """Force Fx, Fy in W, N, potential energy, J, smallest distance, m, nearest body.

    The nearest body is given by its index.
    """
    x, y, vx, vy = state
    bodies, p_WS, gains, tables = world
    stiffness, damping, follow, _, _, every, term = gains
    dx, dy = p_WS[0] - x, p_WS[1] - y
    r = max(math.sqrt(dx * dx + dy * dy), 1e-9)
    pull = stiffness * (1.0 - follow / r)
    fx, fy = pull * dx - damping * vx, pull * dy - damping * vy
    energy = 0.5 * stiffness * (r - follow) ** 2
    least, index = np.inf, -1
    nearest = (0.0, 0.0, 0.0, 0.0)
    for k in range(bodies.shape[0]):
        vector = _nearest(x, y, bodies[k])
        cx, cy, c, _ = vector
        if every > 0.5 and c > 0.0:
            f = _radial_force(vector, (vx, vy), term, tables)
            fx, fy = fx - f * cx / c, fy - f * cy / c
            energy += _lookup(tables[1], c)
        if c < least:
            least, index, nearest = c, k, vector
    if every < 0.5 and least > 0.0:
        f = _radial_force(nearest, (vx, vy), term, tables)
        fx, fy = fx - f * nearest[0] / least, fy - f * nearest[1] / least
        energy += _lookup(tables[1], least)
    return fx, fy, energy, least, index


@njit(cache=True)
def forces(states: _Array, world: _World) -> _Array:  # pragma: no cover  (compiled)
    """Returns (n, 2) forces in W, N, at (n, 4) states x, y, vx, vy in m and m/s."""
    out = np.empty((states.shape[0], 2))
    for i in range(states.shape[0]):
        state = (states[i, 0], states[i, 1], states[i, 2], states[i, 3])
        fx, fy, _, _, _ = _force(state, world)
        out[i, 0], out[i, 1] = fx, fy
    return out


@njit(cache=True)
def _step(state: _State, h: float, world: _World) -> _State:  # pragma: no cover
    """State after one Runge-Kutta step of ``h``, s. |v| is limited to the top speed."""
    x, y, vx, vy = state
    gains = world[2]
    m, g = 1.0 / gains[3], 0.5 * h
    a1, b1, _, _, _ = _force(state, world)
    u2, w2 = vx + g * m * a1, vy + g * m * b1
    middle = (x + g * vx, y + g * vy, u2, w2)
    a2, b2, _, _, _ = _force(middle, world)
    u3, w3 = vx + g * m * a2, vy + g * m * b2
    middle = (x + g * u2, y + g * w2, u3, w3)
    a3, b3, _, _, _ = _force(middle, world)
    u4, w4 = vx + h * m * a3, vy + h * m * b3
    last = (x + h * u3, y + h * w3, u4, w4)
    a4, b4, _, _, _ = _force(last, world)
    x += h / 6.0 * (vx + 2.0 * u2 + 2.0 * u3 + u4)
    y += h / 6.0 * (vy + 2.0 * w2 + 2.0 * w3 + w4)
    vx += h / 6.0 * m * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    vy += h / 6.0 * m * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > gains[4]:
        vx, vy = vx * gains[4] / speed, vy * gains[4] / speed
    return x, y, vx, vy


@njit(cache=True)
def _advance(
    state: _State, h: float, world: _World
) -> tuple[_State, float, float]:  # pragma: no cover  (compiled)
    """State, energy V, J, and smallest distance, m, after one step of ``h`` seconds.

    The force jumps where another body becomes the nearest. A step across such a jump
    has a large error, which would look like a change of the energy. The step is
    therefore repeated in small parts.
    """
    _, _, _, _, before = _force(state, world)
    new = _step(state, h, world)
    _, _, energy, least, after = _force(new, world)
    if after != before:
        new = state
        for _ in range(_SWITCH_PARTS):
            new = _step(new, h / _SWITCH_PARTS, world)
        _, _, energy, least, _ = _force(new, world)
    kinetic = 0.5 * world[2][3] * (new[2] * new[2] + new[3] * new[3])
    return new, energy + kinetic, least


@njit(cache=True)
def run(
    starts: _Array, steps: int, h: float, contact: float, world: _World
) -> tuple[_Array, _Array, _Array]:  # pragma: no cover
    """Integrates from each start until contact, at most ``steps`` steps of ``h``, s.

    ``starts`` are (n, 4) states as in ``forces``. ``contact`` is the distance from a
    body that counts as contact, m. Three arrays are returned:

    - (n,) times of contact, s; infinity for a run without contact
    - (n,) smallest distances, m
    - (n,) largest rises of the energy above its smallest earlier value, J
    """
    count = starts.shape[0]
    times, closest = np.full(count, np.inf), np.full(count, np.inf)
    rises = np.zeros(count)
    for i in range(count):
        state = (starts[i, 0], starts[i, 1], starts[i, 2], starts[i, 3])
        lowest = np.inf
        for k in range(steps):
            state, energy, least = _advance(state, h, world)
            closest[i] = min(closest[i], least)
            if least <= contact:
                times[i] = (k + 1) * h
                break
            lowest = min(lowest, energy)
            rises[i] = max(rises[i], energy - lowest)
    return times, closest, rises


@njit(cache=True)
def trajectory(
    start: _Array, steps: int, h: float, world: _World
) -> _Array:  # pragma: no cover
    """Returns the (steps + 1, 4) states from one start at intervals of ``h``, s."""
    out = np.empty((steps + 1, 4))
    out[0] = start
    state = (start[0], start[1], start[2], start[3])
    for k in range(steps):
        state, _, _ = _advance(state, h, world)
        out[k + 1, 0], out[k + 1, 1], out[k + 1, 2], out[k + 1, 3] = state
    return out
