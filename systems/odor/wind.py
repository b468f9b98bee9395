"""The wind over the floor: uniform, meandering, or the jet of a fan."""

from __future__ import annotations

import math
from functools import partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.noise import (
    BEFORE_THE_RUN,
    TickNoise,
    standard_normals,
    tick_noise,
    tick_normals,
)
from systems.framework.signals import TICK_S
from systems.odor.parameters import WindParameters


class _Places(NamedTuple):
    """Indices in the port ``wind``."""

    jet: int
    """Whether the wind is a jet, 0 or 1."""
    mean: int
    """Mean velocity, x and y, m/s."""
    gust: int
    """Unsteady velocity, x and y, m/s."""
    diameter: int
    """Diameter of the outlet of a jet, m."""
    size: int
    """Size of the port."""


_AT = _Places(*accumulate((1, 2, 2, 1), initial=0))
#: Size of the port ``wind``.
WIND_SIZE = _AT.size
#: Period with which wind and plume change, s.
WIND_PERIOD_S = 0.1
#: Correlation time of the meandering, s.
MEANDER_TIME_S = 8.0
#: Position of the outlet of a jet in W, m.
_ORIGIN_M = (-2.2, 0.0)
#: Growth of the half width of a jet per meter along its axis. At the half width, the
#: speed is exp(-1/2) of the speed on the axis.
_GROWTH = 0.1
#: Distance along which a round jet keeps its speed on the axis, in diameters of the
#: outlet (Pope 2000, 5.1: decay constant 6 for a uniform outlet).
_CORE = 6.0


@njit(cache=True)
def wind_velocity(
    wind: Any, x: float, y: float
) -> tuple[float, float]:  # pragma: no cover  (compiled)
    """Computes the velocity of the wind at a point of the floor.

    The velocity depends on the point only in the jet of a fan:

    - Upwind of the outlet of the fan, there is no wind.
    - On the axis of the jet, the speed is constant along ``_CORE`` diameters of the
      outlet. Farther downwind, it falls with the distance.
    - Across the jet, the speed is a Gaussian function of the distance from the axis.

    Args:
        wind: (WIND_SIZE,) value of the port ``wind``.
        x: x coordinate of the point in the world frame W, m.
        y: y coordinate of the point in W, m.

    Returns:
        (ux, uy), velocity of the wind in W, m/s.
    """
    share = 1.0
    speed = math.hypot(wind[_AT.mean], wind[_AT.mean + 1])
    if wind[_AT.jet] > 0.5 and speed > 0.0:
        dx, dy = x - _ORIGIN_M[0], y - _ORIGIN_M[1]
        along = (dx * wind[_AT.mean] + dy * wind[_AT.mean + 1]) / speed
        across = (dy * wind[_AT.mean] - dx * wind[_AT.mean + 1]) / speed
        if along <= 0.0:
            return 0.0, 0.0
        width = 0.5 * wind[_AT.diameter] + _GROWTH * along
        share = min(1.0, _CORE * wind[_AT.diameter] / along)
        share *= math.exp(-0.5 * (across / width) ** 2)
    ux = share * (wind[_AT.mean] + wind[_AT.gust])
    return ux, share * (wind[_AT.mean + 1] + wind[_AT.gust + 1])


class WindNumbers(NamedTuple):
    """Constants of the step of ``WindField``."""

    spread: float
    """Standard deviation of each component of the unsteady velocity, m/s."""
    keep: float
    """Share of the unsteady velocity that remains after one period."""
    period: int
    """Period of the changes, ticks."""
    noise: TickNoise


def wind_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: WindNumbers
) -> None:
    """Updates the unsteady velocity of the wind once per period of the wind.

    The state has the same values as the output port ``wind``.
    """
    if tick % numbers.period != 0 or numbers.spread == 0.0:
        return
    normals = tick_normals(numbers.noise, tick, 1, 2)
    change = numbers.spread * math.sqrt(1.0 - numbers.keep**2)
    for k in range(2):
        state[_AT.gust + k] = numbers.keep * state[_AT.gust + k] + change * float(
            normals[0, k]
        )


def _publish(state: Any, outputs: Any, numbers: WindNumbers) -> None:
    """Copies the output from the state of ``wind_step``."""
    for k in range(WIND_SIZE):
        outputs[0][k] = state[k]


def initial_wind(own: WindParameters, seed: int) -> NDArray[np.float64]:
    """Computes the value of the port ``wind`` at the start of a run.

    The wind is the sum of a mean velocity and an unsteady velocity. The function draws
    the unsteady velocity from its stationary distribution, with the seed ``seed``. The
    result has the shape (WIND_SIZE,).
    """
    wind = np.zeros(WIND_SIZE)
    direction = math.radians(own.direction_deg)
    wind[_AT.jet] = own.kind == "jet"
    wind[_AT.mean : _AT.mean + 2] = math.cos(direction), math.sin(direction)
    wind[_AT.mean : _AT.mean + 2] *= own.speed_m_s
    wind[_AT.gust : _AT.gust + 2] = (
        _spread(own) * standard_normals((1, 2), seed, BEFORE_THE_RUN)[0]
    )
    wind[_AT.diameter] = own.jet_diameter_m
    return wind


def _spread(own: WindParameters) -> float:
    return 0.0 if own.kind == "uniform" else own.meander_intensity * own.speed_m_s


class WindField(Block):
    """Models the wind over the whole floor.

    The wind is the sum of a mean velocity and an unsteady velocity. Each component of
    the unsteady velocity is an Ornstein-Uhlenbeck process with an exact discretization.
    Obstacles and robots do not affect the wind. The function ``wind_velocity`` computes
    the wind at a point.

    The discrete state has the same values as the output. It changes every 0.1 s.

    Args:
        parameters: Kind, mean and unsteadiness of the wind.
        seed: Seed of the unsteady velocity.
        tick_s: Control period of the robots, s. It must divide 0.1 s, the period of the
            wind.

    Reference: Song 2011, 4.1, for the speeds. The rest is ours.
    """

    part, stage = "wind", "world"
    outputs = (Port("wind", WIND_SIZE, "number, six of them, see systems.odor.wind"),)

    def __init__(
        self,
        *,
        parameters: WindParameters = WindParameters(),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("wind_field")
        period = max(1, round(WIND_PERIOD_S / tick_s))
        keep = math.exp(-period * tick_s / MEANDER_TIME_S)
        numbers = WindNumbers(_spread(parameters), keep, period, tick_noise(seed))
        self._initial = partial(initial_wind, parameters)
        self.declare(
            Step(wind_step, numbers, self._initial(seed), _publish), tick_s=tick_s
        )

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step, with the noise and the initial wind of the run."""
        wind = self._initial(run.seed_of(self.get_name()))
        return super().step_for(run)._replace(state=wind)
