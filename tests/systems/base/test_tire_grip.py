"""Slip by friction against closed forms, optimization and a stiff integration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from pydantic import ValidationError
from pydrake.systems.analysis import (
    ApplySimulatorConfig,
    Simulator,
    SimulatorConfig,
)
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize

from phonotaxis.testing import Bench, assert_linearization, evaluate
from systems.base.diff_drive_plant import DiffDrivePlant
from systems.base.parameters import PlantParameters
from systems.base.robot import RobotParameters
from systems.base.tire_grip import GripNumbers, grip_accelerations

ROBOT = RobotParameters()
G, LAG, RADIUS, HALF = 9.81, 0.05, 0.06, 0.41 / 2
#: Square of the radius of gyration of a plate of 0.35 m x 0.82 m, m^2.
GYRATION = (0.35**2 + 0.82**2) / 12
TOP = 0.72
#: Seconds, and commanded left and right wheel speed in rad/s.
Leg = tuple[float, float, float]


def drive(
    legs: Sequence[Leg],
    start: ArrayLike = (0.0,) * 10,
    *,
    friction: float | None = None,
) -> np.ndarray:
    """(legs, 10) the plant's state at the end of each leg, by the default steps."""
    block = DiffDrivePlant(plant=PlantParameters(friction=friction))
    simulator = Simulator(block)
    config = SimulatorConfig()
    config.integration_scheme = "runge_kutta3"
    config.max_step_size = 0.025
    config.use_error_control = False
    ApplySimulatorConfig(config, simulator)
    context = simulator.get_mutable_context()
    state: Any = np.array(start, dtype=float)
    context.SetContinuousState(state[: context.num_continuous_states()])
    time, states = 0.0, []
    for seconds, *wheel_speeds in legs:
        block.GetInputPort("wheel_speeds").FixValue(context, wheel_speeds)
        time += seconds
        simulator.AdvanceTo(time)
        states.append(context.get_continuous_state_vector().CopyToVector())
    return np.array(states)


def rolling(speed: float) -> list[float]:
    """State of a robot that drives straight ahead without slip."""
    wheel = speed / RADIUS
    return [0.0, 0.0, 0.0, 0.0, 0.0, wheel, wheel, speed, 0.0, 0.0]


def test_full_throttle_start_is_one_of_constant_acceleration():
    """v = mu g t and x = mu g t^2 / 2 while the rims run ahead."""
    acceleration = 0.1 * G
    state = drive([(0.5, 12, 12)], friction=0.1)[0]
    assert state[7] == pytest.approx(acceleration * 0.5, rel=1e-6)
    assert state[0] == pytest.approx(acceleration * 0.5**2 / 2, rel=1e-6)
    assert state[5] == pytest.approx(12 * (1 - math.exp(-0.5 / LAG)), rel=1e-3)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.2])
def test_way_lost_in_a_full_throttle_start(friction):
    """From when the rims meet v = mu g t on all is rolling again."""

    def rim(t):
        return TOP * (1.0 - math.exp(-t / LAG))

    def rim_way(t):
        return TOP * (t - LAG * (1.0 - math.exp(-t / LAG)))

    met = brentq(lambda t: rim(t) - friction * G * t, 0.05, 2.0)
    lost = rim_way(met) - friction * G * met**2 / 2
    state = drive([(2.0, 12, 12)], friction=friction)[0]
    assert RADIUS * state[3] - state[0] == pytest.approx(lost, rel=0.01)
    assert lost > 0.08
    assert state[7] == pytest.approx(TOP, rel=1e-5)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.2])
def test_locked_wheels_stop_after_v_squared_over_2_mu_g(friction):
    state = drive([(3.0, 0, 0)], rolling(0.6), friction=friction)[0]
    distance = 0.6**2 / (2 * friction * G)
    assert state[0] == pytest.approx(distance, rel=0.01)
    assert state[0] > RADIUS * state[3] + 0.02, "and the encoders saw less"
    assert abs(state[7]) < 1e-9


def test_turn_on_the_spot_is_limited_by_both_wheels():
    """Each pushes with mu g / 2 at half the track: the yaw rate grows steadily."""
    limit = 0.1 * G * HALF / GYRATION
    state = drive([(0.25, -12, 12)], friction=0.1)[0]
    assert state[9] == pytest.approx(limit * 0.25, rel=1e-6)
    np.testing.assert_allclose(state[[0, 1, 7, 8]], 0.0, atol=1e-9)


def test_rest_stays_rest():
    np.testing.assert_array_equal(drive([(5.0, 0, 0)], friction=0.01), 0.0)


LEGS: tuple[Leg, ...] = (
    (0.5, 12, 12), (0.5, 12, 4), (0.3, -5, 5), (1.0, 8, 10), (1.5, 0, 0)
)  # fmt: skip


def test_without_slip_where_the_floor_can_give_the_forces():
    """Full throttle asks for 0.72 m/s / 50 ms: 1.5 g, and turning for 1.3 g more."""
    np.testing.assert_allclose(
        drive(LEGS, friction=10.0)[:, :7], drive(LEGS), rtol=1e-9, atol=1e-12
    )


def test_slip_falls_to_nothing_as_friction_grows():
    exact = drive(LEGS)[-1, :2]
    errors = [
        np.hypot(*(drive(LEGS, friction=mu)[-1, :2] - exact))
        for mu in (0.3, 0.6, 1.2, 4.8)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 0.1
    assert errors[-1] < 1e-6


def coulomb(legs: Sequence[Leg], friction: float) -> np.ndarray:
    """(legs, 3) poses by Coulomb's law as it stands, smooth below 0.1 mm/s of slip.

    Stiff: written in the world's frame and integrated by an implicit method.
    """
    state = np.zeros(10)  # x, y, theta, their rates, wheel speeds, wheel angles

    def rates(commanded, s):
        along = np.array([math.cos(s[2]), math.sin(s[2])])
        force, torque = np.zeros(2), 0.0
        for wheel, side in ((s[6], 1.0), (s[7], -1.0)):
            ground = s[3:5] - side * HALF * s[5] * along
            slip = RADIUS * wheel * along - ground
            push = friction * G / 2 * slip / math.sqrt(slip @ slip + 1e-8)
            force, torque = force + push, torque - side * HALF * (push @ along)
        wheels = (np.array(commanded) - s[6:8]) / LAG
        return [*s[3:6], *force, torque / GYRATION, *wheels, *s[6:8]]

    poses = []
    for seconds, *commanded in legs:
        run = solve_ivp(
            lambda _, s, c=commanded: rates(c, s), (0.0, seconds), state, "Radau",
            rtol=1e-6, atol=1e-8,
        )  # fmt: skip
        state = run.y[:, -1]
        poses.append(state[:3])
    return np.array(poses)


@pytest.mark.parametrize("friction", [0.05, 0.1, 0.3, 0.6])
def test_agrees_with_a_stiff_integration_of_coulomb_s_law(friction):
    """Within a tenth of what slip does to the pose."""
    ours = drive(LEGS, friction=friction)[:, :3]
    theirs = coulomb(LEGS, friction)
    without = drive(LEGS)[:, :3]
    slipped = np.max(np.hypot(*(theirs - without).T[:2]))
    off = np.max(np.hypot(*(ours - theirs).T[:2]))
    assert slipped > 0.05
    assert off < 0.1 * slipped
    turned = np.max(np.abs((theirs - without)[:, 2]))
    assert np.max(np.abs((ours - theirs)[:, 2])) < 0.1 * turned


def test_forces_are_the_allowed_ones_that_come_nearest_to_no_slip():
    """Gauss' principle, solved by a general optimizer."""
    rng = np.random.default_rng(0)
    weights = np.array([1.0, 1.0, GYRATION])
    for _ in range(20):
        grip = GripNumbers.of(ROBOT, rng.uniform(0.05, 0.6))
        motion = rng.uniform(-1, 1, 3) * [0.7, 0.2, 3.0]
        rims, changes = rng.uniform(-TOP, TOP, 2), rng.uniform(-15, 15, 2)
        v, sideways, yaw = motion
        ground = np.array([v - yaw * HALF, v + yaw * HALF])
        left, right = changes + (rims - ground) / 0.016
        wanted = [(left + right) / 2, -sideways / 0.016, (right - left) / (2 * HALF)]

        def accelerate(f, motion=motion):
            turn = (f[2] - f[0]) * HALF / GYRATION
            forward = f[0] + f[2] + motion[2] * motion[1]
            return np.array([forward, f[1] + f[3] - motion[2] * motion[0], turn])

        def missed(f, wanted=wanted, accelerate=accelerate):
            return np.sum(weights * (accelerate(f) - wanted) ** 2) / 200.0

        limits = [
            {
                "type": "ineq",
                "fun": lambda f, k=k, limit=grip.traction_m_s2: (
                    1.0 - (f[k] ** 2 + f[k + 1] ** 2) / limit**2
                ),
            }
            for k in (0, 2)
        ]
        best = minimize(
            missed, np.zeros(4), method="SLSQP", constraints=limits,
            options={"ftol": 1e-14, "maxiter": 500},
        )  # fmt: skip
        ours = grip_accelerations(motion, rims, changes, 2 * HALF, grip)
        np.testing.assert_allclose(ours, accelerate(best.x), atol=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_energy_never_grows_over_locked_wheels(seed):
    rng = np.random.default_rng(seed)
    start = np.zeros(10)
    start[7:] = rng.uniform(-1, 1, 3) * [1.0, 1.0, 4.0]
    states = drive([(0.025, 0, 0)] * 100, start, friction=0.1)
    energy = [float(np.sum(s[7:] ** 2 * [1.0, 1.0, GYRATION])) for s in states]
    assert all(after <= before for before, after in pairwise(energy))
    assert energy[0] > 0.01
    assert energy[-1] < 1e-9


def test_spinning_wheels_have_no_hold_to_the_side():
    """Coulomb's force lies along the slip: a spinning axle drifts off a bend."""
    grip = GripNumbers.of(ROBOT, 0.1)
    v, sideways = 0.5, 0.1
    forward, leftward, yaw = grip_accelerations(
        (v, sideways, 0.0), (100.0, 100.0), (0.0, 0.0), 2 * HALF, grip
    )
    slip = np.array([100.0 - v, -sideways])
    along = 0.1 * G * slip / np.linalg.norm(slip)
    np.testing.assert_allclose([forward, leftward, yaw], [*along, 0.0], atol=1e-5)


def test_slip_velocities_are_rims_less_ground():
    state = [0, 0, 0.3, 0, 0, 5.0, 7.0, 0.2, -0.05, 0.4]
    outputs = evaluate(
        DiffDrivePlant(plant=PlantParameters(friction=0.2)),
        state=state,
        wheel_speeds=[0, 0],
    )
    expected = [0.3 - (0.2 - 0.4 * HALF), 0.42 - (0.2 + 0.4 * HALF), -0.05]
    np.testing.assert_allclose(outputs["slip_velocities"], expected)
    c, s = math.cos(0.3), math.sin(0.3)
    velocity = [0.2 * c + 0.05 * s, 0.2 * s - 0.05 * c, 0.4]
    np.testing.assert_allclose(outputs["velocity_WB"], velocity)


def test_a_rolling_robot_slips_by_its_constant_share():
    plant = DiffDrivePlant(plant=PlantParameters(slip=(0.2, 0.0)))
    outputs = evaluate(plant, state=[0, 0, 0, 0, 0, 5.0, 5.0], wheel_speeds=[5, 5])
    np.testing.assert_allclose(outputs["slip_velocities"], [0.06, 0, 0], atol=1e-12)


@pytest.mark.parametrize("wheel_speeds", [[5.1, 4.9], [11.0, -11.0]])
def test_gradient_with_friction(wheel_speeds):
    """Where both wheels hold, and where both slide."""
    block = DiffDrivePlant(plant=PlantParameters(friction=0.4))
    state = [0.5, -0.2, 0.7, 3.0, 2.0, 5.0, 5.0, 0.3, 0.001, 0.01]
    assert_linearization(block, state=state, wheel_speeds=wheel_speeds)


@pytest.mark.parametrize("friction", [0.0, -0.3, 101.0, math.nan, "ice"])
def test_friction_has_a_range(friction):
    with pytest.raises(ValidationError, match="friction"):
        PlantParameters(friction=friction)


def test_a_command_that_is_not_finite_is_an_error_with_friction_too():
    block = DiffDrivePlant(plant=PlantParameters(friction=0.4))
    at = Bench(block, wheel_speeds=[math.nan, 0.0])
    with pytest.raises(ValueError, match=r"DiffDrivePlant: .* block upstream"):
        at.rates()
