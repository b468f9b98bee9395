"""Linear models of the closed loop at an operating point.

The sampled model is computed in two independent ways. The first way differentiates one
whole control period of the diagram with AutoDiff. The second way linearizes each block
alone, and joins the linear blocks with the ``control`` package. The continuous model
uses the same blocks in the limit of a control period that goes to zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.loops.autodiff import seed, value_and_gradient
from analysis.loops.block_models import join_blocks, sampled_blocks
from analysis.loops.diagram_state import Port
from analysis.loops.linear_models import LinearModel, simple_poles
from analysis.loops.operating_points import OperatingPoint

_SOURCE: tuple[Port, ...] = (("hearing", "pose_WS"), ("collision", "pose_WS"))
_INPUTS = ("p_WS_x", "p_WS_y", "theta_WS")
_OUTPUTS = (
    "p_WP_x", "p_WP_y", "theta_WB", "p_PS_B_x", "p_PS_B_y",
    "acceleration_W_x", "acceleration_W_y",
)  # fmt: skip
_READ: tuple[Port, ...] = (
    ("plant", "pose_WB"),
    ("hearing", "p_PS_B"),
    ("controller", "acceleration_W"),
)


def sampled_model(point: OperatingPoint) -> LinearModel:
    """Returns the sampled closed loop, by AutoDiff through one period of the diagram.

    Inputs and outputs are the values at the control update that begins the period.
    Outputs are read before the update. The model has these signals:

    - Input: pose of the source, m and rad.
    - Outputs: position of the control point P, heading, source position that hearing
      reports, and acceleration from the law.
    - States: all states of the diagram.
    """
    loop = point.loop
    found = loop.period_derivatives(
        point.state,
        point.time_s,
        inputs={_SOURCE: loop.scenario.source.path().pose(point.time_s)},
        outputs=_READ,
    )
    to_P = _control_point(point)
    return LinearModel(
        name="closed loop",
        A=found.A,
        B=found.B,
        C=to_P @ found.C,
        D=to_P @ found.D,
        state_names=loop.state_names,
        input_names=_INPUTS,
        output_names=_OUTPUTS,
        period_s=loop.tick_s,
    )


def blockwise_model(point: OperatingPoint) -> LinearModel:
    """Returns the same model as ``sampled_model``, computed in the second way.

    Each block is linearized alone, and the linear blocks are joined.
    """
    loop = point.loop
    joined = join_blocks(
        sampled_blocks(loop, point.state, point.time_s),
        loop.state_names,
        name="closed loop, from blocks",
        inputs=tuple(f"pose_WS[{k}]" for k in range(3)),
        outputs=tuple(
            f"{name}[{k}]"
            for role, name in _READ
            for k in range(loop.block(role).GetOutputPort(name).size())
        ),
    )
    to_P = _control_point(point)
    return replace(
        joined,
        C=to_P @ joined.C,
        D=to_P @ joined.D,
        input_names=_INPUTS,
        output_names=_OUTPUTS,
    )


def _control_point(point: OperatingPoint) -> NDArray[np.float64]:
    """(7, 7) matrix that turns the axle's position in the outputs into that of P."""
    epsilon = point.loop.scenario.only.robot.control_point_m
    matrix = np.eye(len(_OUTPUTS))
    matrix[0, 2] = -epsilon * math.sin(point.theta_WB)
    matrix[1, 2] = epsilon * math.cos(point.theta_WB)
    return matrix


@dataclass(frozen=True)
class RouteComparison:
    """Differences between the results of ``sampled_model`` and ``blockwise_model``."""

    matrix_difference: float
    """Largest difference of an element of A, B, C or D."""
    pole_difference: float
    """Largest distance in the z plane from one of ``simple_poles`` to the nearest pole
    of ``blockwise_model``."""
    simple_poles: NDArray[np.complex128]
    """Poles of ``sampled_model`` in the z plane, without multiple poles and without
    poles near 0."""
    states: int
    """Number of states of the models."""


def compare_routes(point: OperatingPoint) -> RouteComparison:
    """Compares the models of ``sampled_model`` and ``blockwise_model``."""
    whole, joined = sampled_model(point), blockwise_model(point)
    pairs = [(getattr(whole, m), getattr(joined, m)) for m in ("A", "B", "C", "D")]
    poles = simple_poles(whole.poles)
    apart = [float(np.abs(joined.poles - pole).min()) for pole in poles]
    return RouteComparison(
        matrix_difference=max(float(np.abs(a - b).max()) for a, b in pairs),
        pole_difference=max(apart, default=0.0),
        simple_poles=poles,
        states=len(whole.A),
    )


@dataclass(frozen=True)
class GradientCheck:
    """Comparison of the AutoDiff matrix A with finite differences.

    A is the derivative of the state after one control period by the state before it.
    """

    step: float
    """Size of the step in each state, in the SI unit of the state."""
    largest_difference: float
    """Largest absolute difference between an element of A and the central difference
    quotient."""
    largest_at: tuple[str, str]
    """Element of A with the largest difference: name of the state of its row, and name
    of the stepped state, which is that of its column."""
    kink: float
    """Largest absolute difference between the two one-sided difference quotients of an
    element. If ``kink`` is not near zero, the map over one period has a corner. For
    example, the norm |dC/dt| has a corner, where C is the collision vector."""
    kink_at: tuple[str, str]
    """Element with this difference, as in ``largest_at``."""


def check_gradient(point: OperatingPoint, step: float = 1e-6) -> GradientCheck:
    """Compares A with finite differences of the float diagram, state by state.

    Some states are not stepped: those of the tracker except its poses, and the feature
    numbers of the controller, which identify obstacles. Feature numbers are integers.
    The covariances of the tracker are zero with exact hearing, and a step down would
    make them negative. ``step`` is in the SI unit of each state.
    """
    loop, state, time_s = point.loop, point.state, point.time_s
    A = loop.period_derivatives(state, time_s).A
    names = loop.state_names
    columns = [k for k, name in enumerate(names) if _can_step(name)]
    here = loop.period_map(state, time_s)
    central, corner = np.zeros((2, len(A), len(columns)))
    for column, k in enumerate(columns):
        sides = []
        for sign in (1.0, -1.0):
            moved = state.copy()
            moved[k] += sign * step
            sides.append(sign * (loop.period_map(moved, time_s) - here) / step)
        central[:, column] = (sides[0] + sides[1]) / 2.0 - A[:, k]
        corner[:, column] = sides[0] - sides[1]

    def worst(array: NDArray[np.float64]) -> tuple[float, tuple[str, str]]:
        row, column = np.unravel_index(np.abs(array).argmax(), array.shape)
        found = float(abs(array[row, column]))
        return found, (names[int(row)], names[columns[int(column)]])

    largest, at = worst(central)
    kink, kink_at = worst(corner)
    return GradientCheck(step, largest, at, kink, kink_at)


def _can_step(name: str) -> bool:
    """Whether ``check_gradient`` steps the state of this name."""
    role, _, element = name.partition(".")
    if role == "controller":
        return "feature" not in element
    return role != "tracker" or "pose" in element


def continuous_model(point: OperatingPoint) -> LinearModel:
    """Returns the closed loop in continuous time, without sampling and latency.

    The blocks are those of the sampled model. In this limit, odometry and hearing are
    exact and without delay, and the virtual mass becomes an integrator.

    - States: pose of the robot, m and rad, wheel speeds, rad/s, and velocity of the
      virtual mass, m/s.
    - Inputs: position of the source, m, and an acceleration, m/s^2, that is added to
      that of the virtual mass.
    - Outputs: position of the control point P, m, and heading, rad.
    """
    loop = point.loop
    models = sampled_blocks(loop, point.state, point.time_s)
    sensor, controller, command = (
        next(model for model in models if model.name == role)
        for role in ("collision", "controller", "command")
    )
    A_plant, B_plant = plant_jacobians(point)
    moving = [0, 1, 2, 5, 6]  # without wheel angles, which affect nothing else
    A_plant, B_plant = A_plant[np.ix_(moving, moving)], B_plant[moving]
    read, vectors = "acceleration_W", "collision_vectors_B"
    by_vectors = _slope(controller, read, vectors)
    by_pose = _slope(controller, read, "pose_WB_estimated")
    by_pose = by_pose + by_vectors @ _slope(sensor, vectors, "pose_WB")
    by_source = by_vectors @ _slope(sensor, vectors, "pose_WS")
    by_source = _slope(controller, read, "p_WS_estimated") + by_source[:, :2]
    poses = _signals(command.input_names, "pose_WB_estimated")
    wheels_v, wheels_pose = command.A[2:, :2], command.B[np.ix_([2, 3], poses)]
    A = np.zeros((7, 7))
    A[:5, :5] = A_plant
    A[:5, :3] += B_plant @ wheels_pose
    A[:5, 5:] = B_plant @ wheels_v
    A[5:, :3], A[5:, 5:] = by_pose, _slope(controller, read, "v_WP")
    B = np.zeros((7, 4))
    B[5:, :2], B[5:, 2:] = by_source, np.eye(2)
    C = np.zeros((3, 7))
    C[:, :3] = _control_point(point)[:3, :3]
    return LinearModel(
        name="closed loop, continuous",
        A=A,
        B=B,
        C=C,
        D=np.zeros((3, 4)),
        state_names=(
            "plant.x", "plant.y", "plant.theta", "plant.speed_left",
            "plant.speed_right", "command.v_WP_x", "command.v_WP_y",
        ),
        input_names=("p_WS_x", "p_WS_y", "push_x", "push_y"),
        output_names=("p_WP_x", "p_WP_y", "theta_WB"),
    )  # fmt: skip


def _signals(names: Sequence[str], port: str) -> list[int]:
    return [k for k, name in enumerate(names) if name.partition("[")[0] == port]


def _slope(model: LinearModel, of: str, by: str) -> NDArray[np.float64]:
    """Derivative of an output port by an input port at the same control update."""
    rows, columns = _signals(model.output_names, of), _signals(model.input_names, by)
    return model.D[np.ix_(rows, columns)]


def plant_jacobians(
    point: OperatingPoint,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns A (7, 7) and B (7, 2) of the plant in continuous time.

    They are the derivatives of the state's time derivative: A by the state, and B by
    the two commanded wheel speeds. Both matrices are constant in time, because the
    robot rests or drives straight at an operating point.
    """
    loop = point.loop
    plant = loop.block("plant", twin=True)
    context = plant.CreateDefaultContext()
    state = point.state[loop.indices("plant")]
    command = loop.indices("command")
    seeded = seed(np.concatenate([state, point.state[command[2:]]]))
    context.SetContinuousState(seeded[: len(state)])
    plant.GetInputPort("wheel_speeds").FixValue(context, seeded[len(state) :])
    rates = plant.EvalTimeDerivatives(context).CopyToVector()
    _, slope = value_and_gradient(rates, len(seeded))
    return slope[:, : len(state)], slope[:, len(state) :]
