"""Two hot-wire airflow sensors beside a partition."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from pydrake.systems.framework import LeafSystem

from systems.framework.block_facts import BlockFacts
from systems.framework.compiling import njit
from systems.framework.noise import TickNoise, tick_noise, tick_normals
from systems.framework.signals import TICK_S
from systems.framework.step_block import RunFacts, Step, StepBlock, reseeded
from systems.odor.parameters import AirflowParameters
from systems.odor.wind import WIND_SIZE, wind_velocity

#: What a crosswind wire feels of wind along it, as a share of its square.
_ALONG = 0.04


@register_jitable
def airflow_reading(angle: float, side: int, crosswind: bool) -> float:  # noqa: FBT001
    """What a sensor reads of a wind of unit speed.

    Args:
        angle: Where the wind comes from, from ahead, CCW, rad.
        side: 0 left, 1 right.
        crosswind: Whether its lobe is that of a wire along the axis.

    Returns:
        0 to 1.
    """
    if not crosswind:
        axis = 0.25 * math.pi if side == 0 else -0.25 * math.pi
        return max(0.0, math.cos(angle - axis))
    across = math.sin(angle) if side == 0 else -math.sin(angle)
    return math.sqrt(max(0.0, across) ** 2 + _ALONG * math.cos(angle) ** 2)


class AirflowNumbers(NamedTuple):
    """What the step of ``AirflowSensors`` depends on."""

    gain: float
    crosswind: bool
    noise_share: float
    noise: TickNoise


@njit(cache=True)
def _wind_at(wind: Any, pose: Any) -> tuple[float, float]:  # pragma: no cover
    return wind_velocity(wind, pose[0], pose[1])


@register_jitable
def airflow_step(
    tick: int, state: Any, inputs: Any, outputs: Any, numbers: AirflowNumbers
) -> None:
    """Readings of one tick; see ``systems.framework.step_block.Step``.

    Args:
        tick: Number of the tick.
        state: None.
        inputs: As the input ports.
        outputs: As the output ports.
        numbers: ``AirflowNumbers``.
    """
    wind, pose = inputs
    ux, uy = _wind_at(np.asarray(wind), np.asarray(pose))
    speed = math.hypot(ux, uy)
    source = math.atan2(-uy, -ux) - pose[2]
    normals = tick_normals(numbers.noise, tick, 1, 2)
    for k in range(2):
        value = numbers.gain * speed * airflow_reading(source, k, numbers.crosswind)
        outputs[0][k] = value * (1.0 + numbers.noise_share * float(normals[0, k]))


class AirflowSensors(LeafSystem, StepBlock):
    """Feels from which side the wind blows.

    .. pydrake_system::

        name: AirflowSensors
        input_ports:
        - wind [number, nine of them, see systems.odor.wind]
        - pose_WB [m, m, rad]
        output_ports:
        - airflow [1, left and right]

    F1 looks 45 deg to the left, F2 to the right; the wind is that at the origin of B.

    No state; noise is drawn every tick. Latency: none.

    Args:
        parameters: ``AirflowParameters``.
        seed: Of the noise.
        tick_s: Period of the robot, s.

    Reference: Song 2011, 2.1, 2.3.3; the lobes are ours.
    """

    FACTS = BlockFacts(
        "airflow",
        "obstacle sensing",
        columns={"airflow": ("airflow_left", "airflow_right")},
    )

    def __init__(
        self,
        *,
        parameters: AirflowParameters | None = None,
        seed: int = 0,
        tick_s: float = TICK_S,
    ) -> None:
        super().__init__()
        own = parameters or AirflowParameters()
        numbers = AirflowNumbers(
            own.gain_s_m, own.lobe == "crosswind", own.noise, tick_noise(seed)
        )
        self.set_name("airflow_sensors")
        self.declare_step(
            float,
            Step(airflow_step, numbers),
            (("wind", WIND_SIZE), ("pose_WB", 3)),
            (("airflow", 2),),
            tick_s,
        )

    def step_for(self, run: RunFacts) -> Step:
        """What the block does in each tick of a compiled loop."""
        return reseeded(self, run)
