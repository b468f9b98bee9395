"""Two hot-wire airflow sensors next to a partition."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba.extending import register_jitable

from systems.framework.block import Block, Port, Step
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.odor.parameters import AirflowParameters
from systems.odor.wind import WIND_SIZE, wind_velocity

#: Standard deviation of a reading, divided by the reading.
_NOISE_SHARE = 0.02
#: Square of the relative sensitivity of a crosswind wire to wind along the wire.
_ALONG = 0.04


@register_jitable
def airflow_reading(angle: float, side: int, crosswind: bool) -> float:  # noqa: FBT001
    """Computes the relative reading of an airflow sensor.

    Args:
        angle: Direction from which the wind comes, counterclockwise from straight
            ahead, rad.
        side: 0 for the left sensor, 1 for the right sensor.
        crosswind: Directional sensitivity of the sensor: ``crosswind`` if true,
            ``cosine`` if false.

    Returns:
        Reading divided by the wind speed and the gain, 0 to 1.
    """
    if not crosswind:
        axis = 0.25 * math.pi if side == 0 else -0.25 * math.pi
        return max(0.0, math.cos(angle - axis))
    across = math.sin(angle) if side == 0 else -math.sin(angle)
    return math.sqrt(max(0.0, across) ** 2 + _ALONG * math.cos(angle) ** 2)


class AirflowNumbers(NamedTuple):
    """Constants of the step of ``AirflowSensors``."""

    gain: float
    crosswind: bool
    noise: TickNoise


@register_jitable
def airflow_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: AirflowNumbers
) -> None:
    """Computes the readings of both sensors."""
    wind, pose = inputs
    ux, uy = wind_velocity(wind, pose[0], pose[1])
    speed = math.hypot(ux, uy)
    source = math.atan2(-uy, -ux) - pose[2]
    normals = tick_normals(numbers.noise, tick, 1, 2)
    for k in range(2):
        value = numbers.gain * speed * airflow_reading(source, k, numbers.crosswind)
        outputs[0][k] = value * (1.0 + _NOISE_SHARE * float(normals[0, k]))


class AirflowSensors(Block):
    """Measures the wind with two airflow sensors on the left and right of the robot.

    With the directional sensitivity ``cosine``, the left sensor F1 points 45 deg to the
    left. The right sensor F2 points 45 deg to the right. Both sensors measure the wind
    at the middle of the axle.

    The block has no state. It draws new noise at every tick (control period). There is
    no latency.

    Args:
        parameters: Gain and directional sensitivity (lobe).
        seed: Seed of the noise.
        tick_s: Control period of the robot, s.

    Reference: Song 2011, 2.1 and 2.3.3. The directional sensitivities are ours.
    """

    part, stage = "airflow", "obstacle sensing"
    inputs = (
        Port("wind", WIND_SIZE, "number, six of them, see systems.odor.wind"),
        Port("pose_WB", 3, "m, m, rad"),
    )
    outputs = (
        Port("airflow", 2, "1, left and right", ("airflow_left", "airflow_right")),
    )

    def __init__(
        self,
        *,
        parameters: AirflowParameters = AirflowParameters(),
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        self.set_name("airflow_sensors")
        numbers = AirflowNumbers(
            parameters.gain_s_m,
            parameters.lobe == "crosswind",
            tick_noise(seed),
        )
        self.declare(Step(airflow_step, numbers), tick_s=tick_s, arrays=True)
