"""Drake's closed loop against scipy, written from the equations alone.

Nothing here comes from ``systems``: the laws, the sensors, the virtual mass
and the plant are written again from docs/model.md.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagrams import build_sound_follower, make_simulator
from diagrams.scenario import Scenario

T = 0.025
EPSILON, MASS, RADIUS, SEPARATION, TOP = 0.175, 3.94, 0.06, 0.41, 0.72
LAG = 0.05
K_R, D_R, FOLLOW = 2.0, 1.0, 1.2
K_0, D_0, RHO_0 = 16.0, 0.8, 0.8
K_REF, D_REF, MU_0 = 64.0, 0.2, 0.72
ALPHA = RHO_0 / (2 * np.log(K_REF / K_0))
BETA = MU_0 / (2 * np.log(D_0 / D_REF))

SOURCE_START, SOURCE_VELOCITY = np.array([1.6, 0.3]), np.array([0.3, 0.0])
SOURCE_SIZE = (0.326, 0.352)
BOX, BOX_SIZE = np.array([2.8, 0.9]), (0.2, 0.1)
MOVING_START, MOVING_VELOCITY = np.array([4.4, -2.0]), np.array([0.0, 0.2])
MOVING_SIZE = (0.3, 0.2)
DURATION = 20.0


def scenario(law: str) -> Scenario:
    return Scenario.model_validate(
        {
            "law": law,
            "hearing": "ideal",
            "obstacle_sensing": "ideal",
            "duration_s": DURATION,
            "odometry": {"rounding": False},
            "tracker": {"hold": "world"},
            "integrator": {"scheme": "runge_kutta5", "step_s": 0.005},
            "source": {"waypoints_m": [SOURCE_START.tolist(), [9.0, 0.3]]},
            "obstacles": [
                {"name": "box", "waypoints_m": [BOX.tolist()], "size_m": BOX_SIZE},
                {
                    "name": "moving",
                    "waypoints_m": [MOVING_START.tolist(), [4.4, 3.0]],
                    "speed_m_s": 0.2,
                    "size_m": MOVING_SIZE,
                },
            ],
        }
    )


def rotation(theta: float) -> np.ndarray:
    return np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])


def nearest_vector(p: np.ndarray, time: float) -> tuple[int, np.ndarray] | None:
    """(body, vector to its nearest point) of the nearest body within 3 m."""
    bodies = [
        (BOX, 0.0, BOX_SIZE),
        (MOVING_START + MOVING_VELOCITY * time, np.pi / 2, MOVING_SIZE),
        (SOURCE_START + SOURCE_VELOCITY * time, 0.0, SOURCE_SIZE),
    ]
    vectors = []
    for centre, heading, size in bodies:
        R = rotation(heading)
        local = R.T @ (p - centre)
        half = np.array(size) / 2
        vectors.append(R @ np.clip(local, -half, half) + centre - p)
    distances = [np.linalg.norm(v) for v in vectors]
    index = int(np.argmin(distances))
    return (index, vectors[index]) if distances[index] <= 3.0 else None


def law_force(law: str, c: float, s: float) -> float:
    if law == "conventional":
        return K_0 * (RHO_0 - c) + D_0 * s if c < RHO_0 else 0.0
    damper = D_REF * np.exp(s / BETA) * (MU_0 - s) if s < MU_0 else 0.0
    return K_REF * np.exp(-c / ALPHA) * c + damper


def plant(_, x, command):
    left, right = x[5], x[6]
    v = RADIUS * (left + right) / 2
    return [
        v * np.cos(x[2]),
        v * np.sin(x[2]),
        RADIUS * (right - left) / SEPARATION,
        left,
        right,
        (command[0] - left) / LAG,
        (command[1] - right) / LAG,
    ]


def integrate_independently(law: str) -> tuple[np.ndarray, np.ndarray]:
    """Plant state (7) and virtual velocity (2) at the end."""
    x = np.zeros(7)
    odometry, angles = np.zeros(3), np.zeros(2)
    velocity = np.zeros(2)
    heard = None  # the sensor's tick: p_PS_B measured a tick ago
    pose_then = np.zeros(3)
    target = None
    remembered = None
    for k in range(round(DURATION / T)):
        time = k * T
        turned = x[3:5] - angles
        forward = RADIUS * turned.mean()
        turn = RADIUS * (turned[1] - turned[0]) / SEPARATION
        mean = odometry[2] + turn / 2
        step = np.array([forward * np.cos(mean), forward * np.sin(mean), turn])
        odometry = odometry + step
        angles = x[3:5].copy()
        ahead = rotation(odometry[2]) @ [EPSILON, 0.0]
        p = odometry[:2] + ahead

        if heard is not None:
            R = rotation(pose_then[2])
            target = pose_then[:2] + R @ (heard + np.array([EPSILON, 0.0]))
        force = -MASS / 0.5 * velocity
        if target is not None:
            d = target - p
            force = K_R * d * (1 - FOLLOW / np.linalg.norm(d)) - D_R * velocity

        p_true = x[:2] + rotation(x[2]) @ [EPSILON, 0.0]
        seen = nearest_vector(p_true, time)
        if seen is not None:
            body, C = seen
            C = rotation(odometry[2]) @ rotation(x[2]).T @ C
            s: float = 0.0
            if remembered is not None and remembered[0] == body:
                s = float(np.linalg.norm(C - remembered[1])) / T
            c = float(np.linalg.norm(C))
            force = force - law_force(law, c, s) * C / c
            remembered = (body, C)
        else:
            remembered = None

        velocity = velocity + T * force / MASS
        if (speed := np.linalg.norm(velocity)) > TOP:
            velocity = velocity * TOP / speed
        along, across = rotation(odometry[2]).T @ velocity
        omega = across / EPSILON
        command = (
            np.array([along - omega * SEPARATION / 2, along + omega * SEPARATION / 2])
            / RADIUS
        )
        command /= max(1.0, np.abs(command).max() / (TOP / RADIUS))

        sounding = (time - T / 2) % 2.0 < 0.5 and time > T / 2
        source = SOURCE_START + SOURCE_VELOCITY * time
        heard = rotation(x[2]).T @ (source - p_true) if sounding else None
        pose_then = odometry.copy()
        x = solve_ivp(
            plant, (0, T), x, "DOP853", args=(command,), rtol=1e-12, atol=1e-13
        ).y[:, -1]
    return x, velocity


@pytest.mark.slow
@pytest.mark.parametrize("law", ["conventional", "active"])
def test_drake_agrees_with_scipy_to_1e_6_over_20_s(law):
    follower = build_sound_follower(scenario(law))
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(DURATION)
    context = simulator.get_context()
    command = follower.blocks["command"].GetMyContextFromRoot(context)

    state, velocity = integrate_independently(law)

    drake_state = context.get_continuous_state_vector().CopyToVector()
    np.testing.assert_allclose(drake_state, state, atol=1e-6, rtol=0)
    drake_velocity = command.get_discrete_state(0).CopyToVector()[:2]
    np.testing.assert_allclose(drake_velocity, velocity, atol=1e-6, rtol=0)
    assert np.linalg.norm(state[:2]) > 3.0, "the robot must have gone somewhere"


@pytest.mark.slow
def test_default_step_is_within_20_um_of_a_fine_one():
    """What ``IntegratorParameters`` claims."""
    ends = []
    for integrator in ({}, {"scheme": "runge_kutta5", "step_s": 0.0025}):
        data = scenario("active").model_dump() | {"integrator": integrator}
        follower = build_sound_follower(Scenario.model_validate(data))
        simulator = make_simulator(follower)
        simulator.Initialize()
        simulator.AdvanceTo(DURATION)
        context = simulator.get_context()
        ends.append(context.get_continuous_state_vector().CopyToVector()[:3])
    np.testing.assert_allclose(ends[0], ends[1], atol=20e-6, rtol=0)
