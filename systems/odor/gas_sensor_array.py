"""Metal-oxide gas sensors on three arms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.faults import DEAD, FROZEN, Fault, fault_ticks
from systems.framework.noise import (
    BEFORE_THE_RUN,
    TickNoise,
    standard_normals,
    tick_noise,
    tick_normals,
)
from systems.framework.signals import TICK_S
from systems.odor.odor_plume import PLUME_SIZE, concentration
from systems.odor.parameters import GAS_EXPONENT, GAS_SENSORS, GasSensorParameters

#: Two time constants for each preset, s: the first applies while the concentration
#: grows, and the second while it falls.
_TIMES_S = {"song2011": (2.5, 5.8), "tgs2620": (2.96, 15.71)}
#: Standard deviation of the exponents between sensors, divided by that of R0 (both
#: relative).
_EXPONENT_MISMATCH = 3.0


class GasNumbers(NamedTuple):
    """Constants of the step of ``GasSensorArray``."""

    positions: NDArray[np.float64]
    """(3, 2) positions of the sensors in B, m."""
    scales: NDArray[np.float64]
    """(3,) factors of the readings, due to the mismatch of R0."""
    exponents: NDArray[np.float64]
    """(3,) exponents of the power law."""
    response: float
    """Share of the deviation that vanishes per tick while the concentration grows."""
    recovery: float
    """Share of the deviation that vanishes per tick while the concentration falls."""
    noise_share: float
    faults: NDArray[np.int64]
    """(3, 2) faults, see ``fault_ticks``."""
    noise: TickNoise


@njit(cache=True)
def _concentrations(
    plume: Any, pose: Any, positions: Any, out: Any
) -> None:  # pragma: no cover  (compiled)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(positions)):
        x, y = positions[k, 0], positions[k, 1]
        place = pose[0] + c * x - s * y, pose[1] + s * x + c * y
        out[k] = concentration(plume, place[0], place[1])


@register_jitable
def gas_sensor_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: GasNumbers
) -> None:
    """Computes the readings of three gas sensors in one tick (control period).

    A reading is the ratio Rs/R0 of the sensor's resistance in gas to its resistance in
    clean air. The state has six numbers: the three ratios without noise, then the last
    three readings.
    """
    ratios, truths = outputs
    gas = np.empty(3)
    _concentrations(inputs[0], inputs[1], numbers.positions, gas)
    normals = tick_normals(numbers.noise, tick, 1, 4)
    for k in range(3):
        # First-order lag toward the steady ratio. More gas means a smaller ratio.
        rest = (1.0 + gas[k]) ** -numbers.exponents[k]
        share = numbers.response if rest < state[k] else numbers.recovery
        state[k] += share * (rest - state[k])
        # Mismatch, noise and faults.
        value = state[k] * numbers.scales[k]
        value *= 1.0 + numbers.noise_share * float(normals[0, k])
        kind, begin = numbers.faults[k]
        if kind == DEAD and tick >= begin:
            value = 1.0
        elif kind == FROZEN and tick >= begin:
            value = state[3 + k]
        state[3 + k] = value
        ratios[k], truths[k] = value, gas[k]


class GasSensorArray(Block):
    """Measures the concentration of gas at three positions on the robot.

    A reading is the ratio Rs/R0 of the sensor's resistance in gas to its resistance in
    clean air. It is 1 in clean air, and smaller in gas. In steady gas of the
    concentration C, the ratio is (1 + C/C1)^-exponent, where C1 is a constant of the
    sensors. The reading follows this value with a first-order lag, which is shorter
    while the concentration grows than while it falls. The sensors and the odor source
    are at the height of the floor. The output ``gas_concentration`` is the true C/C1.

    The discrete state contains the ratio and the last reading of each sensor. Apart
    from the lag, there is no latency.

    Args:
        parameters: Positions, lag and errors of the sensors.
        faults: Faults of all sensors of the robot. Only faults of ``gas_sensors`` have
            an effect.
        seed: Seed of the noise, and of the differences between the sensors.
        tick_s: Control period of the robot, s.

    Reference: Song 2011, 2.1 and 2.3.3. The power law and the time constants of the
    TGS2620 sensor are from the simulator GADEN.
    """

    part, stage = "gas", "obstacle sensing"
    inputs = (
        Port("plume", PLUME_SIZE, "number, many, see systems.odor.odor_plume"),
        Port("pose_WB", 3, "m, m, rad"),
    )
    outputs = (
        Port(
            "gas_ratio",
            GAS_SENSORS,
            "1, right front, rear and left front",
            ("gas_right", "gas_rear", "gas_left"),
        ),
        Port(
            "gas_concentration",
            GAS_SENSORS,
            "1, shares of C1, in the same order",
            ("concentration_right", "concentration_rear", "concentration_left"),
        ),
    )

    def __init__(
        self,
        *,
        parameters: GasSensorParameters = GasSensorParameters(),
        faults: Sequence[Fault] = (),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("gas_sensor_array")
        self._numbers_of = partial(_numbers, parameters, faults, tick_s)
        state = [1.0] * (2 * GAS_SENSORS)
        self.declare(
            Step(gas_sensor_step, self._numbers_of(seed), state),
            tick_s=tick_s,
            arrays=True,
        )

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step with the noise and the sensor mismatch of the run."""
        numbers = self._numbers_of(run.seed_of(self.get_name()))
        return self.step._replace(numbers=numbers)


def _numbers(
    own: GasSensorParameters, faults: Sequence[Fault], tick_s: float, seed: int
) -> GasNumbers:
    drawn = standard_normals((2, GAS_SENSORS), seed, BEFORE_THE_RUN)
    response_s, recovery_s = _TIMES_S[own.preset]
    return GasNumbers(
        np.array(own.positions_m),
        1.0 + own.mismatch * drawn[0],
        GAS_EXPONENT * (1.0 + _EXPONENT_MISMATCH * own.mismatch * drawn[1]),
        -math.expm1(-tick_s / response_s),
        -math.expm1(-tick_s / recovery_s),
        own.noise,
        fault_ticks(faults, "gas_sensors", GAS_SENSORS, tick_s),
        tick_noise(seed),
    )
