"""Contact mode: how stiff an obstacle may be, against motor lag and latency.

Near an obstacle the spring to it adds to the attraction's, and the damping is
still the attraction's alone. What is left of it after the motors' lag, the
sample period and the age of the echo decides. The chain from acceleration to
motion is that of the blocks: the plant linearised by Drake and sampled exactly,
the wheel command by AutoDiff. Velocity terms of the laws are left out: over an
oscillation about a resting obstacle the printed ones damp nothing on average.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.analysis import DiscreteTimeApproximation
from pydrake.systems.primitives import Linearize
from scipy.optimize import brentq

from analysis.laws.push_and_pull import stiffest
from analysis.models.block_models import block_model
from analysis.models.ideal_scenarios import require_rolling
from analysis.models.linear_models import LinearModel
from analysis.models.model_reduction import minimal_model
from diagrams.scenario.scenario import Scenario
from systems import DiffDrivePlant
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.wheel_speed_command import WheelCommand_

#: Springs that are tried, N/m.
_STIFFNESSES = np.geomspace(1e-3, 1e5, 400)
#: A spectral radius above 1 by more than this is no rounding.
_ROUNDING = 1e-11
#: Motor lags and latencies of the table.
MOTOR_LAGS_S = (0.01, 0.02, 0.05, 0.1, 0.2)
LATENCY_TICKS = (0, 1, 2, 3, 4)


def motion_chain(
    scenario: Scenario,
    *,
    motor_lag_s: float | None = None,
    period_s: float | None = None,
) -> LinearModel:
    """How P moves along the robot's axis, from ``acceleration_W`` on, at rest.

    Input: the law's acceleration at the tick, m/s^2. Outputs at the tick,
    before its updates: position of P, m, and velocity of the virtual mass, m/s.

    Args:
        scenario: Robot and plant are used.
        motor_lag_s: In place of ``plant.motor_lag_s``, s.
        period_s: In place of the scenario's tick, s.

    Returns:
        The model of one period, of as few states as the motion along the axis has.

    Raises:
        ValueError: The wheels can slip.
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
    C[0, 0] = C[1, -2] = 1.0  # at heading 0, P is as far along x as B
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
    """The same model with one of its outputs some ticks older.

    Args:
        model: Sampled.
        output: One of its output names.
        ticks: How much older, 0 or more periods.

    Returns:
        A model with as many more states, ``<output>_1`` and so on.
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


def contact_matrix(
    scenario: Scenario,
    stiffness_n_m: float,
    *,
    damping_n_s_m: float | None = None,
    motor_lag_s: float | None = None,
    latency_ticks: int = 0,
    approach_damping_n_s_m: float = 0.0,
    period_s: float | None = None,
) -> NDArray[np.float64]:
    """One-period matrix of the radial motion before an obstacle.

    Args:
        scenario: Mass, robot, plant and damping are used.
        stiffness_n_m: All springs together, K_r + K_0, N/m.
        damping_n_s_m: In place of D_r, N s/m.
        motor_lag_s: In place of ``plant.motor_lag_s``, s.
        latency_ticks: Age of the position that the springs act on; 0 in the
            builds, where an echo drives the wheels at once.
        approach_damping_n_s_m: Slope of a law in the obstacle's speed, which is
            the change of that position over a tick, N s/m. For the half of an
            oscillation in which the obstacle comes nearer.
        period_s: In place of the scenario's tick, s.

    Returns:
        (n, n) x+ = A x; states are those of ``motion_chain``, then the aged positions,
        m.
    """
    damping = damping_n_s_m
    if damping is None:
        damping = scenario.follower.attraction.damping_n_s_m
    chain = motion_chain(scenario, motor_lag_s=motor_lag_s, period_s=period_s)
    now = delayed_output(chain, "p_WP", latency_ticks)
    law = np.array([[-stiffness_n_m, -damping]]) / scenario.only.robot.mass_kg
    if approach_damping_n_s_m == 0.0:
        return now.A + now.B @ law @ now.C
    before = delayed_output(chain, "p_WP", latency_ticks + 1)
    # The longer chain holds the shorter one's position too, one place earlier.
    period = period_s or scenario.tick_s
    speed = approach_damping_n_s_m / period / scenario.only.robot.mass_kg
    position = np.hstack([now.C[0], [0.0]])
    row = law[0, 0] * position + law[0, 1] * before.C[1]
    row = row - speed * (position - before.C[0])
    return before.A + before.B @ row[None]


class ContactOptions(TypedDict, total=False):
    """Of ``contact_matrix``, in the place of what the scenario says."""

    damping_n_s_m: float | None
    motor_lag_s: float | None
    latency_ticks: int
    period_s: float | None


def contact_spectral_radius(
    scenario: Scenario, stiffness_n_m: float, **options: Unpack[ContactOptions]
) -> float:
    """Largest |z| of the radial motion; stable below 1. See ``contact_matrix``.

    Args:
        scenario: Mass, robot, plant and damping are used.
        stiffness_n_m: All springs together, N/m.
        **options: See ``contact_matrix``.

    Returns:
        |z| over one period, 0 or more.
    """
    matrix = contact_matrix(scenario, stiffness_n_m, **options)
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def largest_contact_stiffness(
    scenario: Scenario, **options: Unpack[ContactOptions]
) -> float:
    """Sum of springs, K_r + K_0, at which the radial motion stops decaying, N/m.

    Zero where no spring is stable, as without damping.

    Args:
        scenario: Mass, robot, plant and damping are used.
        **options: See ``contact_matrix``.

    Returns:
        N/m; infinite where every spring that is tried is stable.
    """

    def excess(stiffness: float) -> float:
        return contact_spectral_radius(scenario, stiffness, **options) - 1.0

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
    """Largest gains that do not oscillate before a resting obstacle."""

    motor_lags_s: tuple[float, ...]
    """s, one a row."""
    latency_ticks: tuple[int, ...]
    """A tick each, one a column."""
    stiffness_n_m: NDArray[np.float64]
    """(rows, columns) largest K_0 of the conventional law, N/m; negative where
    the attraction alone is too stiff."""
    reference_stiffness_n_m: NDArray[np.float64]
    """(rows, columns) largest k_ref of the active law, N/m, by its largest slope."""
    today: tuple[float, int]
    """Motor lag, s, and latency, ticks, of the scenario."""
    stiffness_today_n_m: float
    """K_0 of the scenario, N/m."""
    reference_stiffness_today_n_m: float
    """k_ref of the scenario, N/m."""
    active_slope_today_n_m: float
    """Largest slope -df/dc of the active law of the scenario, N/m."""
    tick_s: float
    """Of the scenario, s."""


def contact_limits(
    scenario: Scenario,
    *,
    motor_lags_s: Sequence[float] = MOTOR_LAGS_S,
    latency_ticks: Sequence[int] = LATENCY_TICKS,
) -> ContactLimits:
    """The table of limits; the scenario's own motor lag is one of its rows.

    Args:
        scenario: Mass, robot, plant and attraction are used.
        motor_lags_s: Rows of the table, s.
        latency_ticks: Columns of the table: ages of the position, periods.

    Returns:
        Gains of both laws, N/m, with K_r taken off.
    """
    lags = sorted({*motor_lags_s, scenario.only.plant.motor_lag_s})
    total = np.array(
        [
            [
                largest_contact_stiffness(
                    scenario, motor_lag_s=lag, latency_ticks=ticks
                )
                for ticks in latency_ticks
            ]
            for lag in lags
        ]
    )
    left = total - scenario.follower.attraction.stiffness_n_m
    k_ref = scenario.follower.laws.active.reference_stiffness_n_m
    slope = stiffest("active", scenario)
    return ContactLimits(
        motor_lags_s=tuple(lags),
        latency_ticks=tuple(latency_ticks),
        stiffness_n_m=left,
        reference_stiffness_n_m=left * (k_ref / slope),
        today=(scenario.only.plant.motor_lag_s, 0),
        stiffness_today_n_m=scenario.follower.laws.conventional.stiffness_n_m,
        reference_stiffness_today_n_m=k_ref,
        active_slope_today_n_m=slope,
        tick_s=scenario.tick_s,
    )
