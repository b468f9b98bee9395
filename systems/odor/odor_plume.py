"""The plume of an odor source: puffs that the wind carries, or their mean."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.input_error import InputError
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.odor.parameters import GAS_EXPONENT, OdorParameters, WindParameters
from systems.odor.steady_plume import steady_concentration
from systems.odor.wind import WIND_PERIOD_S, WIND_SIZE, initial_wind, wind_velocity

#: Number of puffs released per second, 1/s.
_PUFFS_PER_S = 16.0
#: Largest number of puffs. The source releases this number in 20 s. The plume drops the
#: oldest puffs first.
MOST_PUFFS = 320
#: ``_LEVEL_GROWTH``: growth of the horizontal spread of a puff per distance traveled.
#: ``_UPRIGHT_GROWTH``: growth of the vertical spread per distance traveled. It is also
#: gamma_2 / u of the steady plume.
_LEVEL_GROWTH, _UPRIGHT_GROWTH = 0.12, 0.13
#: ``_OWN_INTENSITY``: standard deviation of each component of a puff's own velocity,
#: divided by the wind speed. ``OWN_TIME_S``: correlation time of this velocity, s.
_OWN_INTENSITY, OWN_TIME_S = 0.1, 2.0
#: Distance from the source beyond which puffs are removed, m.
_REACH_M = 6.0
#: gamma_1 / u, growth of the horizontal spread of the steady plume per distance. Near
#: the source, the puffs spread at this rate in the default wind. At 2 m downwind, the
#: rate of the puffs is about 0.19.
_MEAN_INTENSITY = 0.197


class _PlumePlaces(NamedTuple):
    """Indices in the port ``plume``, before the puffs."""

    background: int
    """Uniform background concentration, in units of C1."""
    steady: int
    """Whether the plume is steady, 0 or 1."""
    puffs: int
    """Number of puffs."""
    part: int
    """Share of the next puff that the source has already released, 0 to 1."""
    age: int
    """Time since the beginning of the release, s."""


class _PuffPlaces(NamedTuple):
    """Indices in the numbers of a puff."""

    x: int
    """Position of the center in W, x and y, m."""
    y: int
    vx: int
    """Velocity relative to the wind in W, x and y, m/s."""
    vy: int
    level: int
    """Horizontal spread, m."""
    upright: int
    """Vertical spread, m."""
    amount: int
    """Amount of odor, in units of C1, m^3."""


class _SteadyPlaces(NamedTuple):
    """Indices in the port ``plume`` for a steady plume, which has no puffs."""

    x: int
    """Position of the source in W, x and y, m."""
    y: int
    cosine: int
    """Cosine and sine of the direction toward which the wind blows."""
    sine: int
    rate: int
    """Release rate of the source, in units of C1, m^3/s."""
    speed: int
    """Speed of the wind, m/s."""


_AT = _PlumePlaces(*range(5))
#: Index of the first puff in the port.
PUFFS_BEGIN = len(_AT)
_PUFF = _PuffPlaces(*range(7))
#: Number of values of a puff.
PUFF_SIZE = len(_PUFF)
_MEAN_PLUME = _SteadyPlaces(*range(PUFFS_BEGIN, PUFFS_BEGIN + 6))
#: Size of the port ``plume``.
PLUME_SIZE = PUFFS_BEGIN + PUFF_SIZE * MOST_PUFFS
#: Smallest spread of a puff, m.
_SMALLEST_M = 0.01
#: Smallest wind speed for the growth of the spreads, m/s.
_STILL_M_S = 0.05
#: Smallest wind speed of a steady plume, m/s.
_STEADY_M_S = 1e-3
#: The concentration of a puff is 0 beyond this number of horizontal spreads.
_FAR = 6.0
#: Longest simulated time before a run, s.
_LONGEST_SPIN_UP_S = 25.0


@njit(cache=True)
def _mean_concentration(
    x: float, y: float, rate: float, speed: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the concentration in the steady plume, see ``steady_concentration``."""
    level, upright = _MEAN_INTENSITY * speed, _UPRIGHT_GROWTH * speed
    return steady_concentration(x, y, rate, speed, (level, level, upright))


def release_rate(ratio_at_2_m: float) -> float:
    """Computes the release rate of a source from a gas sensor's reading 2 m downwind.

    ``ratio_at_2_m`` is the mean ratio Rs/R0 of the sensor in a wind of 1 m/s. The
    result is the release rate divided by C1, m^3/s. C1 is a constant of the gas sensors
    with the unit of a concentration.
    """
    wanted = ratio_at_2_m ** (-1.0 / GAS_EXPONENT) - 1.0
    return wanted / float(_mean_concentration(2.0, 0.0, 1.0, 1.0))


@njit(cache=True)
def concentration(
    plume: Any, x: float, y: float
) -> float:  # pragma: no cover  (compiled)
    """Computes the concentration of odor at a point of the floor.

    The result is the sum over all puffs, plus the background. A puff is a Gaussian
    distribution of odor around its center on the floor. The floor reflects the odor.
    For a steady plume, which has no puffs, ``steady_concentration`` replaces the sum.

    Args:
        plume: (PLUME_SIZE,) value of the port ``plume``.
        x: x coordinate of the point in the world frame W, m.
        y: y coordinate of the point in W, m.

    Returns:
        Concentration in units of C1, a constant of the gas sensors.
    """
    total = plume[_AT.background]
    if plume[_AT.steady] > 0.5:
        at = _MEAN_PLUME
        dx, dy = x - plume[at.x], y - plume[at.y]
        c, s = plume[at.cosine], plume[at.sine]
        u, v = c * dx + s * dy, c * dy - s * dx
        return total + _mean_concentration(u, v, plume[at.rate], plume[at.speed])
    for puff in range(int(plume[_AT.puffs])):
        first = PUFFS_BEGIN + PUFF_SIZE * puff
        level = max(plume[first + _PUFF.level], _SMALLEST_M)
        upright = max(plume[first + _PUFF.upright], _SMALLEST_M)
        dx, dy = x - plume[first + _PUFF.x], y - plume[first + _PUFF.y]
        off = (dx * dx + dy * dy) / (level * level)
        if off > _FAR * _FAR:
            continue
        dense = plume[first + _PUFF.amount] / (level * level * upright)
        # The reflection at the floor doubles the concentration.
        total += dense * math.exp(-0.5 * off) * 2.0 / (2.0 * math.pi) ** 1.5
    return total


class PlumeNumbers(NamedTuple):
    """Constants of the step of ``OdorPlume``."""

    x: float
    """Position of the source in W, x and y, m."""
    y: float
    rate: float
    own_keep: float
    """Share of a puff's own velocity that remains after one period."""
    volume: float
    """Volume of the room, m^3. 0: no background."""
    period: int
    """Period of the changes, ticks."""
    period_s: float
    steady: bool
    noise: TickNoise


@njit(cache=True)
def _advance(
    plume: Any, wind: Any, tick: int, numbers: PlumeNumbers
) -> None:  # pragma: no cover  (compiled)
    """Moves all puffs by one period of the plume, and releases new puffs.

    - Motion: A puff moves with the wind at its center plus its own velocity. The own
      velocity is an Ornstein-Uhlenbeck process with a standard deviation proportional
      to the wind speed.
    - Growth: The size of a puff grows with the distance that the wind covers.
    - Removal: Puffs farther than ``_REACH_M`` from the source disappear. If there are
      more than ``MOST_PUFFS`` puffs, the oldest disappear.

    The port ``plume`` contains the puffs in the order of their age, oldest first.
    """
    dt = numbers.period_s
    plume[_AT.age] += dt
    if numbers.volume > 0.0:
        plume[_AT.background] = numbers.rate * plume[_AT.age] / numbers.volume
    if numbers.steady:
        return
    normals = tick_normals(numbers.noise, tick, 2 * MOST_PUFFS, 2)
    change = math.sqrt(1.0 - numbers.own_keep**2) * _OWN_INTENSITY
    # Moves the existing puffs, and closes the gaps of removed puffs.
    kept = 0
    for puff in range(int(plume[_AT.puffs])):
        old, new = PUFFS_BEGIN + PUFF_SIZE * puff, PUFFS_BEGIN + PUFF_SIZE * kept
        x, y = plume[old + _PUFF.x], plume[old + _PUFF.y]
        ux, uy = wind_velocity(wind, x, y)
        speed = math.hypot(ux, uy)
        spread, keep = change * speed, numbers.own_keep
        vx = keep * plume[old + _PUFF.vx] + spread * normals[puff, 0]
        vy = keep * plume[old + _PUFF.vy] + spread * normals[puff, 1]
        x, y = x + dt * (ux + vx), y + dt * (uy + vy)
        if math.hypot(x - numbers.x, y - numbers.y) > _REACH_M:
            continue
        way = dt * max(speed, _STILL_M_S)
        plume[new + _PUFF.x], plume[new + _PUFF.y] = x, y
        plume[new + _PUFF.vx], plume[new + _PUFF.vy] = vx, vy
        level, upright = _LEVEL_GROWTH * way, _UPRIGHT_GROWTH * way
        plume[new + _PUFF.level] = plume[old + _PUFF.level] + level
        plume[new + _PUFF.upright] = plume[old + _PUFF.upright] + upright
        plume[new + _PUFF.amount] = plume[old + _PUFF.amount]
        kept += 1
    # Computes the number of new puffs, and makes space for them.
    before = plume[_AT.part]
    plume[_AT.part] += dt * _PUFFS_PER_S
    fresh = int(plume[_AT.part])
    plume[_AT.part] -= fresh
    if kept + fresh > MOST_PUFFS:
        drop = kept + fresh - MOST_PUFFS
        for k in range(PUFF_SIZE * (kept - drop)):
            plume[PUFFS_BEGIN + k] = plume[PUFFS_BEGIN + PUFF_SIZE * drop + k]
        kept -= drop
    # Releases the new puffs at the source.
    ux, uy = wind_velocity(wind, numbers.x, numbers.y)
    speed = math.hypot(ux, uy)
    for k in range(fresh):
        # Time since the release of the puff within the period. The oldest is first.
        age = dt - (k + 1.0 - before) / _PUFFS_PER_S
        first, row = PUFFS_BEGIN + PUFF_SIZE * kept, MOST_PUFFS + k
        vx = _OWN_INTENSITY * speed * normals[row, 0]
        vy = _OWN_INTENSITY * speed * normals[row, 1]
        way = age * max(speed, _STILL_M_S)
        plume[first + _PUFF.x] = numbers.x + age * (ux + vx)
        plume[first + _PUFF.y] = numbers.y + age * (uy + vy)
        plume[first + _PUFF.vx], plume[first + _PUFF.vy] = vx, vy
        plume[first + _PUFF.level] = _LEVEL_GROWTH * way
        plume[first + _PUFF.upright] = _UPRIGHT_GROWTH * way
        plume[first + _PUFF.amount] = numbers.rate / _PUFFS_PER_S
        kept += 1
    plume[_AT.puffs] = kept


@register_jitable
def plume_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: PlumeNumbers
) -> None:
    """Updates the odor plume once per period of the plume.

    The state has the same values as the output port ``plume``.
    """
    if tick % numbers.period == 0:
        _advance(state, inputs[0], tick, numbers)


@njit(cache=True)
def _copy(values: Any, into: Any) -> None:  # pragma: no cover  (compiled)
    """Copies (n,) numbers. In Python, this loop would take longer than the step."""
    for k in range(len(values)):
        into[k] = values[k]


@register_jitable
def _publish(state: Any, outputs: Any, numbers: PlumeNumbers) -> None:
    """Copies the output from the state of ``plume_step``."""
    _copy(state, outputs[0])


class OdorPlume(Block):
    """Models the odor plume of a source over the whole floor.

    The plume is steady or consists of puffs. A puff moves with the wind at its center
    plus its own velocity, and grows with the distance that the wind carries it. The
    floor reflects the odor, but walls and robots do not affect it. At the start of a
    run, the source has already released odor for ``age_s``. The function
    ``concentration`` computes the concentration at a point.

    The discrete state has the same values as the output. It changes every 0.1 s, and
    depends on the wind 0.1 s before the change.

    Args:
        parameters: Position, kind and strength of the source.
        wind: Wind before the run. A steady plume has this wind during the run, too.
        seed: Seed of the puffs' own velocities.
        tick_s: Control period of the robots, s. It must divide 0.1 s, the period of the
            plume.

    Raises:
        InputError: The plume is steady, but there is no wind.

    Reference: Song 2011, 2.2, eq. 1 to 6. The puffs and all numbers are ours.
    """

    part, stage = "plume", "world"
    inputs = (Port("wind", WIND_SIZE, "number, six of them, see systems.odor.wind"),)
    outputs = (Port("plume", PLUME_SIZE, "number, many, see systems.odor.odor_plume"),)

    def __init__(
        self,
        *,
        parameters: OdorParameters = OdorParameters(),
        wind: WindParameters = WindParameters(),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        if parameters.kind == "steady" and wind.speed_m_s < _STEADY_M_S:
            raise InputError(
                "wind.speed_m_s",
                f"is {wind.speed_m_s:g}, but a steady plume (odor.kind) is "
                "unbounded without wind; set it to 0.5 or more, or odor.kind to "
                "puffs",
            )
        self.set_name("odor_plume")
        self._step_of = partial(_step, parameters, wind, tick_s)
        self.declare(self._step_of(seed), tick_s=tick_s, arrays=True)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step, with the noise and the initial plume of the run."""
        return self._step_of(run.seed_of(self.get_name()))


def _step(own: OdorParameters, wind: WindParameters, tick_s: float, seed: int) -> Step:
    period = max(1, round(WIND_PERIOD_S / tick_s))
    period_s = period * tick_s
    numbers = PlumeNumbers(
        *own.position_m,
        release_rate(own.ratio_at_2_m),
        math.exp(-period_s / OWN_TIME_S),
        own.room_volume_m3 or 0.0,
        period,
        period_s,
        own.kind == "steady",
        tick_noise(seed),
    )
    plume = np.zeros(PLUME_SIZE)
    if numbers.steady:
        direction, speed = math.radians(wind.direction_deg), wind.speed_m_s
        plume[_AT.steady] = 1.0
        plume[[*_MEAN_PLUME]] = (
            *own.position_m,
            math.cos(direction),
            math.sin(direction),
            numbers.rate,
            speed,
        )
    else:
        # Simulates the puffs before the run, in a constant wind.
        before = initial_wind(wind, seed)
        for k in range(round(min(own.age_s, _LONGEST_SPIN_UP_S) / period_s)):
            _advance(plume, before, -1 - k, numbers)
    plume[_AT.age] = own.age_s
    if numbers.volume > 0.0:
        plume[_AT.background] = numbers.rate * own.age_s / numbers.volume
    return Step(plume_step, numbers, plume, _publish)
