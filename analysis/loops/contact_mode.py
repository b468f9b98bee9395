"""Contact mode: largest stable stiffness of the motion straight toward an obstacle.

The push of the law acts as a spring between the robot and a nearby obstacle. Its
stiffness adds to that of the attraction. The damping is that of the attraction alone.
Motor lag, sample period, and age of the echo reduce the effect of the damping, and so
limit the stiffness. In this module, "latency" is the age of the echo.

The model from acceleration to motion uses the blocks of the diagram. Drake linearizes
the plant and converts it exactly to sampled time. AutoDiff linearizes the block that
commands the wheels. The velocity term, which is the part of the push that depends on
speed, is left out. With the definition of speed in the papers, this term has no damping
on average over an oscillation in front of an obstacle at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import DiscreteTimeApproximation
from pydrake.systems.primitives import Linearize
from scipy.optimize import brentq

from analysis.loops.block_models import block_model
from analysis.loops.ideal_scenarios import require_rolling
from analysis.loops.linear_models import LinearModel, minimal_model
from analysis.loops.radial_law import radial_law
from diagrams.scenario.scenario import Scenario
from systems import DiffDrivePlant
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import WheelCommand_

#: Stiffnesses to examine, N/m.
_STIFFNESSES = np.geomspace(1e-3, 1e5, 400)
#: A spectral radius above 1 by less than this is a rounding error.
_ROUNDING = 1e-11
#: Motor lags in the tables of ``ContactLimits``, s.
_MOTOR_LAGS_S = (0.01, 0.02, 0.05, 0.1, 0.2)
#: Latencies in the tables of ``ContactLimits``, in control periods.
_LATENCY_TICKS = (0, 1, 2, 3, 4)


def motion_chain(
    scenario: Scenario,
    *,
    motor_lag_s: float | None = None,
    period_s: float | None = None,
) -> LinearModel:
    """Returns the model from the law's acceleration to the robot's forward motion.

    The model is linearized at rest. Input and outputs are the values just before the
    control update that begins a period. The model has only the controllable and
    observable states.

    - Input: ``acceleration``, m/s^2.
    - Outputs: position of the control point P, m, and velocity of the virtual mass,
      m/s.

    ``motor_lag_s`` and ``period_s``, the control period, replace values of the
    scenario. Raises InputError if the wheels can slip (``plant.friction`` is set).
    """
    plant = scenario.only.plant
    require_rolling(plant)
    if motor_lag_s is not None:
        plant = plant.model_copy(update={"motor_lag_s": motor_lag_s})
    return _chain(scenario.only.robot, plant, period_s or scenario.tick_s)


@lru_cache(maxsize=256)
def _chain(
    robot: RobotParameters, plant: PlantParameters, period_s: float
) -> LinearModel:
    block = DiffDrivePlant(robot=robot, plant=plant)
    context = block.CreateDefaultContext()
    wheels, pose = block.GetInputPort("wheel_speeds"), block.GetOutputPort("pose_WB")
    wheels.FixValue(context, [0.0, 0.0])
    continuous = Linearize(block, context, wheels.get_index(), pose.get_index())
    sampled = DiscreteTimeApproximation(continuous, period_s)

    command = WheelCommand_[AutoDiffXd](robot=robot, tick_s=period_s)
    rest = [np.zeros(2), np.zeros(3)]
    update = block_model(command, np.zeros(4), rest, period_s=period_s)
    push = update.B[:, 0]
    v, w = slice(0, 2), slice(2, 4)
    A = np.block(
        [
            [sampled.A(), sampled.B() @ update.A[w, v]],
            [np.zeros((2, len(sampled.A()))), update.A[v, v]],
        ]
    )
    B = np.concatenate([sampled.B() @ push[w], push[v]])[:, None]
    C = np.zeros((2, len(A)))
    C[0, 0] = C[1, -2] = 1.0  # at heading 0, P and the axle differ in x by a constant
    whole = LinearModel(
        name="motion of P",
        A=A,
        B=B,
        C=C,
        D=np.zeros((2, 1)),
        state_names=tuple(f"motion_{k}" for k in range(len(A))),
        input_names=("acceleration",),
        output_names=("p_WP", "v_WP"),
        period_s=period_s,
    )
    return minimal_model(whole)


def delayed_output(model: LinearModel, output: str, ticks: int) -> LinearModel:
    """Returns the model with the output named ``output`` delayed by ``ticks`` periods.

    ``ticks`` is 0 or more. Each period of delay adds a state: ``<output>_1``,
    ``<output>_2``, and so on.
    """
    if ticks == 0:
        return model
    row, count = model.output_names.index(output), len(model.A)
    A = np.zeros((count + ticks, count + ticks))
    A[:count, :count] = model.A
    A[count, :count] = model.C[row]
    A[count + 1 :, count:-1] = np.eye(ticks - 1)
    C = np.hstack([model.C, np.zeros((len(model.C), ticks))])
    C[row] = np.eye(count + ticks)[-1]
    return replace(
        model,
        A=A,
        B=np.vstack([model.B, np.zeros((ticks, model.B.shape[1]))]),
        C=C,
        state_names=(*model.state_names, *(f"{output}_{k + 1}" for k in range(ticks))),
    )


def contact_model(
    scenario: Scenario,
    stiffness_n_m: float,
    *,
    damping_n_s_m: float | None = None,
    motor_lag_s: float | None = None,
    latency_ticks: int = 0,
    approach_damping_n_s_m: float = 0.0,
    period_s: float | None = None,
) -> LinearModel:
    """Returns the sampled model of the robot's motion straight toward an obstacle.

    ``stiffness_n_m`` is the sum of the stiffnesses of attraction and push. Both forces
    depend on a position that is ``latency_ticks`` control periods old. In the diagram,
    this latency is 0: an echo affects the wheels in the same period.

    ``approach_damping_n_s_m`` is the derivative of the push by the speed of approach.
    This speed is the mean rate of the position over the last period. With a value other
    than 0, the model is valid only while the robot and the obstacle approach.

    ``damping_n_s_m``, ``motor_lag_s`` and ``period_s`` replace values of the scenario.
    The model has the signals of ``motion_chain``. Its states are those of
    ``motion_chain``, followed by the delayed positions, m.
    """
    damping = damping_n_s_m
    if damping is None:
        damping = scenario.follower.attraction.damping_n_s_m
    chain = motion_chain(scenario, motor_lag_s=motor_lag_s, period_s=period_s)
    now = delayed_output(chain, "p_WP", latency_ticks)
    law = np.array([[-stiffness_n_m, -damping]]) / scenario.only.robot.mass_kg
    if approach_damping_n_s_m == 0.0:
        return replace(now, A=now.A + now.B @ law @ now.C)
    before = delayed_output(chain, "p_WP", latency_ticks + 1)
    # The longer chain contains the position of the shorter chain, one state earlier.
    period = period_s or scenario.tick_s
    speed = approach_damping_n_s_m / period / scenario.only.robot.mass_kg
    position = np.hstack([now.C[0], [0.0]])
    row = law[0, 0] * position + law[0, 1] * before.C[1]
    row = row - speed * (position - before.C[0])
    return replace(before, A=before.A + before.B @ row[None])


class ContactOptions(TypedDict, total=False):
    """Options of ``contact_model`` that replace values of the scenario."""

    damping_n_s_m: float | None
    motor_lag_s: float | None
    latency_ticks: int
    period_s: float | None


def largest_contact_stiffness(
    scenario: Scenario, **options: Unpack[ContactOptions]
) -> float:
    """Returns the largest stable stiffness of the motion toward an obstacle, N/m.

    The stiffness is the sum of the stiffnesses of attraction and push. It is 0 if no
    stiffness is stable, for example without damping. It is infinite if all stiffnesses
    up to 1e5 N/m are stable. ``options`` are those of ``contact_model``.
    """

    def excess(stiffness: float) -> float:
        return contact_model(scenario, stiffness, **options).spectral_radius - 1.0

    below = 0.0
    for stiffness in _STIFFNESSES:
        if excess(stiffness) > _ROUNDING:
            if below == 0.0:
                return 0.0
            return float(brentq(excess, below, stiffness, xtol=1e-9))
        below = float(stiffness)
    return math.inf


@dataclass(frozen=True)
class ContactLimits:
    """Largest gains for which the motion toward an obstacle at rest is stable.

    The rows of the tables are motor lags, and the columns are latencies of the echo.
    """

    motor_lags_s: tuple[float, ...]
    """Motor lags of the rows, s."""
    latency_ticks: tuple[int, ...]
    """Latencies of the columns, in control periods."""
    stiffness_n_m: NDArray[np.float64]
    """(rows, columns) largest stiffness K_0 of the conventional law, N/m. A negative
    value means that the attraction alone is too stiff."""
    reference_stiffness_n_m: NDArray[np.float64]
    """(rows, columns) largest gain k_ref of the active law, N/m. The law is at the
    distance at which it is stiffest, and its stiffness is proportional to k_ref."""
    today: tuple[float, int]
    """Motor lag of the scenario, s, and its latency in control periods."""
    stiffness_today_n_m: float
    """K_0 of the scenario, N/m."""
    reference_stiffness_today_n_m: float
    """k_ref of the scenario, N/m."""
    active_slope_today_n_m: float
    """Largest stiffness -df/dc of the active law with the scenario's gains, N/m."""
    tick_s: float
    """Control period, s."""


def contact_limits(scenario: Scenario) -> ContactLimits:
    """Computes the largest stable gains of the conventional and of the active law.

    The gains follow from the largest stable stiffness minus the stiffness of the
    attraction. The motor lag of the scenario is one of the rows of the tables.
    """
    lags = sorted({*_MOTOR_LAGS_S, scenario.only.plant.motor_lag_s})
    total = np.array(
        [
            [
                largest_contact_stiffness(
                    scenario, motor_lag_s=lag, latency_ticks=ticks
                )
                for ticks in _LATENCY_TICKS
            ]
            for lag in lags
        ]
    )
    left = total - scenario.follower.attraction.stiffness_n_m
    k_ref = scenario.follower.laws.active.reference_stiffness_n_m
    slope = radial_law(scenario.with_robot(law="active")).stiffest_n_m
    return ContactLimits(
        motor_lags_s=tuple(lags),
        latency_ticks=_LATENCY_TICKS,
        stiffness_n_m=left,
        reference_stiffness_n_m=left * (k_ref / slope),
        today=(scenario.only.plant.motor_lag_s, 0),
        stiffness_today_n_m=scenario.follower.laws.conventional.stiffness_n_m,
        reference_stiffness_today_n_m=k_ref,
        active_slope_today_n_m=slope,
        tick_s=scenario.tick_s,
    )
