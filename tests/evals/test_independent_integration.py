"""The laws and the closed loop against an implementation of their own.

Nothing here that computes comes from ``systems``: the laws, the sensors, the
virtual mass and the plant are written again from docs/model.md.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

from diagrams import build_sound_follower, make_simulator
from diagrams.scenario.scenario import Scenario
from phonotaxis.testing import Bench
from systems import (
    ActiveImpedance2017Controller,
    ActiveImpedanceController,
    ConventionalImpedance2017Controller,
    ConventionalImpedanceController,
)
from systems.laws import catalog
from systems.laws.active import active_force
from systems.laws.active_2017 import active_2017_force
from systems.laws.conventional import conventional_force
from systems.laws.conventional_2017 import conventional_2017_force
from systems.laws.impedance_controller import (
    attraction_force,
    obstacle_speed,
    repulsion_force,
)
from systems.laws.parameters import AttractionParameters

pytestmark = pytest.mark.drake

T = 0.025
EPSILON, MASS, RADIUS, SEPARATION, TOP = 0.175, 3.94, 0.06, 0.41, 0.72
LAG = 0.05
K_R, D_R, FOLLOW = 2.0, 1.0, 1.2
K_0, D_0, RHO_0 = 16.0, 0.8, 0.8
K_REF, D_REF, MU_0 = 64.0, 0.2, 0.72
ALPHA = RHO_0 / (2 * np.log(K_REF / K_0))
BETA = MU_0 / (2 * np.log(D_0 / D_REF))
K_2017, RHO_1, D_2017, MU_1 = 1.1, 0.1, 0.7, 0.6
LEAST = 0.03

ATTRACTION = {
    "stiffness_n_m": K_R, "damping_n_s_m": D_R, "follow_distance_m": FOLLOW
}  # fmt: skip
REPULSION: dict[str, Any] = {
    "conventional": {"stiffness_n_m": K_0, "damping_n_s_m": D_0, "reach_m": RHO_0},
    "active": {
        "reference_stiffness_n_m": K_REF,
        "matched_stiffness_n_m": K_0,
        "reach_m": RHO_0,
        "reference_damping_n_s_m": D_REF,
        "matched_damping_n_s_m": D_0,
        "speed_limit_m_s": MU_0,
    },
    "conventional2017": {"distance_gain_j": K_2017, "damping_n_s_m": D_2017},
    "active2017": {
        "distance_gain_j": K_2017,
        "saturation_distance_m": RHO_1,
        "damping_n_s_m": D_2017,
        "saturation_speed_m_s": MU_1,
    },
}
LAWS = tuple(REPULSION)
TERMS = ("printed", "closing")

SOURCE_START, SOURCE_WAY, SOURCE_SPEED = np.array([1.6, 0.3]), 7.4, 0.3
SOURCE_SIZE = (0.326, 0.352)
BOX, BOX_SIZE = np.array([2.8, 0.9]), (0.2, 0.1)
MOVING_START, MOVING_WAY, MOVING_SPEED = np.array([4.4, -2.0]), 5.0, 0.2
#: Of source and moving obstacle, where they start and brake, m/s^2.
RAMP = 1.0
MOVING_SIZE = (0.3, 0.2)
DURATION = 40.0
#: Nodes and weights on [0, 1]: exact to 1e-15 over a tick.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
NODES, WEIGHTS = (NODES + 1.0) / 2.0, WEIGHTS / 2.0


def scenario(law: str, velocity_term: str = "printed") -> Scenario:
    return Scenario.model_validate(
        {
            "law": law,
            "hearing": "ideal",
            "obstacle_sensing": "ideal",
            "duration_s": DURATION,
            "plant": {"pulses_per_revolution": None},
            "tracker": {"hold": "world"},
            "attraction": ATTRACTION,
            "collision_vector": {"velocity_term": velocity_term},
            "laws": REPULSION,
            "integration_step_s": 0.005,
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
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def trapezoid(time: float, way: float, speed: float) -> tuple[float, float]:
    """Way and speed from rest to rest; all of it is long enough to cruise."""
    ends = way / speed + speed / RAMP
    if time > ends / 2.0:
        left, speed_then = trapezoid(max(ends - time, 0.0), way, speed)
        return way - left, speed_then
    if time < speed / RAMP:
        return RAMP * time**2 / 2.0, RAMP * time
    return speed * (time - speed / RAMP / 2.0), speed


@cache
def driven_ways() -> list[float]:
    """Ways of the source at the ticks: straight on, its wheels follow in closed form.

    The command is the speed to have when it has taken effect and 2/s of what is
    missing, but leads the wheels by no more than 2 m/s^2 times the lag.
    """
    way, wheel, ways = 0.0, 0.0, [0.0]
    kept = math.exp(-T / LAG)
    for tick in range(round(DURATION / T)):
        planned, _ = trapezoid(tick * T, SOURCE_WAY, SOURCE_SPEED)
        _, ahead = trapezoid(tick * T + LAG + T / 2.0, SOURCE_WAY, SOURCE_SPEED)
        lead = ahead + 2.0 * (planned - way) - wheel
        lead = min(max(lead, -2.0 * LAG), 2.0 * LAG)
        way += wheel * T + lead * (T - LAG * (1.0 - kept))
        wheel += lead * (1.0 - kept)
        ways.append(way)
    return ways


def source_position(time: float) -> np.ndarray:
    """At a tick."""
    return SOURCE_START + np.array([driven_ways()[round(time / T)], 0.0])


def nearest_vector(p: np.ndarray, time: float) -> tuple[int, np.ndarray] | None:
    """(body, vector to its nearest point) of the nearest body within 3 m."""
    bodies = [
        (BOX, 0.0, BOX_SIZE),
        (
            MOVING_START
            + np.array([0.0, trapezoid(time, MOVING_WAY, MOVING_SPEED)[0]]),
            np.pi / 2,
            MOVING_SIZE,
        ),
        (source_position(time), 0.0, SOURCE_SIZE),
    ]
    vectors = []
    for center, heading, size in bodies:
        R = rotation(heading)
        local = R.T @ (p - center)
        half = np.array(size) / 2
        vectors.append(R @ np.clip(local, -half, half) + center - p)
    distances = [np.linalg.norm(v) for v in vectors]
    index = int(np.argmin(distances))
    return (index, vectors[index]) if distances[index] <= 3.0 else None


def aimed(d: np.ndarray, theta: Any) -> np.ndarray:
    """(n, 2) ways to targets, those straight behind turned aside (docs/model.md)."""
    z = (d[..., 0] + 1j * d[..., 1]) * np.exp(-1j * np.asarray(theta))
    least = np.tan(np.radians(5.0)) * (-z.real - 0.3)
    aside = np.where(z.imag < 0.0, -1.0, 1.0) * least
    turned = np.where(np.abs(z.imag) < least, z.real + 1j * aside, z)
    turned = turned * np.exp(1j * np.asarray(theta))
    return np.stack([turned.real, turned.imag], axis=-1)


def law_force(law: str, c: Any, s: Any) -> Any:
    """(n,) force away from the obstacle, N, at (n,) distances and speeds."""
    if law == "conventional":
        return np.where(c < RHO_0, K_0 * (RHO_0 - c) + D_0 * s, 0.0)
    if law == "active":
        slow = np.minimum(s, MU_0)
        damper = D_REF * np.exp(slow / BETA) * (MU_0 - slow)
        return K_REF * np.exp(-c / ALPHA) * c + damper
    if law == "conventional2017":
        return K_2017 / np.maximum(c, LEAST) + D_2017 * s
    K_a = np.where(c >= RHO_1, K_2017, K_2017 * c / RHO_1)
    D_a = np.where(s <= MU_1, D_2017, D_2017 * MU_1 / np.maximum(s, MU_1))
    return K_a / c + D_a * s


def law_speed(velocity_term: str, C: np.ndarray, before: np.ndarray) -> Any:
    """(n,) s in m/s of (n, 2) collision vectors a period apart."""
    if velocity_term == "printed":
        return np.linalg.norm(C - before, axis=-1) / T
    nearer = np.linalg.norm(before, axis=-1) - np.linalg.norm(C, axis=-1)
    return np.maximum(0.0, nearer / T)


def move(x: np.ndarray, command: np.ndarray) -> np.ndarray:
    """Plant state a tick later: wheels and heading exact, position by quadrature.

    Wheel speeds decay to the command: w(t) = command + (w_0 - command) e^(-t/lag).
    """
    excess = x[5:7] - command

    def turned(t):
        """(2, ...) angles by which the wheels have turned after t."""
        decayed = LAG * -np.expm1(-t / LAG)
        return np.multiply.outer(command, t) + np.multiply.outer(excess, decayed)

    t = T * NODES
    wheels = command[:, None] + np.multiply.outer(excess, np.exp(-t / LAG))
    left, right = turned(t)
    heading = x[2] + RADIUS * (right - left) / SEPARATION
    v = RADIUS * wheels.mean(axis=0) * T * WEIGHTS
    angles = turned(T)
    return np.array(
        [
            x[0] + v @ np.cos(heading),
            x[1] + v @ np.sin(heading),
            x[2] + RADIUS * (angles[1] - angles[0]) / SEPARATION,
            *(x[3:5] + angles),
            *(command + excess * np.exp(-T / LAG)),
        ]
    )


def integrate_independently(
    law: str, velocity_term: str
) -> tuple[np.ndarray, np.ndarray]:
    """Plant state (7) and virtual velocity (2) at the end."""
    x = np.zeros(7)
    velocity = np.zeros(2)
    heard = None  # the sensor's tick: p_PS_B measured a tick ago
    pose_then = np.zeros(3)
    target = None
    remembered = None
    for k in range(round(DURATION / T)):
        time = k * T
        odometry = x[:3].copy()  # that of rolling wheels, without rounding, is exact
        ahead = rotation(odometry[2]) @ [EPSILON, 0.0]
        p = odometry[:2] + ahead

        if heard is not None:
            R = rotation(pose_then[2])
            target = pose_then[:2] + R @ (heard + np.array([EPSILON, 0.0]))
        force = -MASS / 0.5 * velocity
        if target is not None:
            d = aimed(target - p, odometry[2])
            force = K_R * d * (1 - FOLLOW / np.linalg.norm(d)) - D_R * velocity

        p_true = x[:2] + rotation(x[2]) @ [EPSILON, 0.0]
        seen = nearest_vector(p_true, time)
        if seen is not None:
            body, C = seen
            C = rotation(odometry[2]) @ rotation(x[2]).T @ C
            s: float = 0.0
            if remembered is not None and remembered[0] == body:
                s = float(law_speed(velocity_term, C, remembered[1]))
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
        offset = source_position(time) - p_true
        heard = rotation(x[2]).T @ offset if sounding else None
        pose_then = odometry.copy()
        x = move(x, command)
    return x, velocity


def random_states(count: int, seed: int) -> dict[str, np.ndarray]:
    """Targets, robots and obstacles; s on both sides of mu_0 and mu_1."""
    rng = np.random.default_rng(seed)
    direction = rng.uniform(-np.pi, np.pi, (2, count))
    c, s = rng.uniform(0.01, 3.0, count), rng.uniform(0.0, 2.0, count)
    C = c * np.array([np.cos(direction[0]), np.sin(direction[0])])
    change = s * T * np.array([np.cos(direction[1]), np.sin(direction[1])])
    return {
        "p_WS": rng.uniform(-5.0, 5.0, (count, 2)),
        "p_WP": rng.uniform(-5.0, 5.0, (count, 2)),
        "v_WP": rng.uniform(-0.72, 0.72, (count, 2)),
        "C": C.T,
        "before": (C - change).T,
    }


def total_force(
    law: str, velocity_term: str, state: dict[str, np.ndarray], theta: Any = None
) -> Any:
    """(n, 2) F_m + F_b in W, N; of robots with (n,) headings, if they are given."""
    d, C = state["p_WS"] - state["p_WP"], state["C"]
    if theta is not None:
        straight, d = d, aimed(d, theta)
        assert np.count_nonzero(np.any(np.abs(d - straight) > 1e-9, axis=1)) > 20
    reach = np.linalg.norm(d, axis=1, keepdims=True)
    F_m = K_R * d * (1.0 - FOLLOW / reach) - D_R * state["v_WP"]
    c = np.linalg.norm(C, axis=1)
    f = law_force(law, c, law_speed(velocity_term, C, state["before"]))
    return F_m - (f / c)[:, None] * C


FUNCTIONS: dict[str, Any] = {
    "conventional": conventional_force,
    "active": active_force,
    "conventional2017": lambda c, s, gains: conventional_2017_force(c, s, gains, LEAST),
    "active2017": active_2017_force,
}
BLOCKS: dict[str, Any] = {
    "conventional": ConventionalImpedanceController,
    "active": ActiveImpedanceController,
    "conventional2017": ConventionalImpedance2017Controller,
    "active2017": ActiveImpedance2017Controller,
}


def gains_of(law: str) -> Any:
    model: Any = catalog.LAWS[law].gains
    return model.model_validate(REPULSION[law])


@cache
def pulls_at_1e5_states() -> np.ndarray:
    """(n, 2) F_m, which is that of every law."""
    state = random_states(100_000, seed=1)
    gains = AttractionParameters.model_validate(ATTRACTION)
    columns = (state[name].tolist() for name in ("p_WS", "p_WP", "v_WP"))
    return np.array(
        [
            attraction_force(p_WP, v_WP, p_WS, True, gains, MASS)
            for p_WS, p_WP, v_WP in zip(*columns, strict=True)
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("velocity_term", TERMS)
@pytest.mark.parametrize("law", LAWS)
def test_force_is_the_same_to_1e_9_at_1e5_states(law, velocity_term):
    state = random_states(100_000, seed=1)
    gains = gains_of(law)
    force = FUNCTIONS[law]

    closing = velocity_term == "closing"
    pairs = zip(state["C"].tolist(), state["before"].tolist(), strict=True)
    pushes = [
        repulsion_force(C, obstacle_speed(C, before, closing, T), force, (gains,))
        for C, before in pairs
    ]
    found = pulls_at_1e5_states() + np.array(pushes)
    expected = total_force(law, velocity_term, state)
    np.testing.assert_allclose(found, expected, atol=1e-9, rtol=0)
    speeds = law_speed(velocity_term, state["C"], state["before"])
    assert 0.1 < np.mean(speeds < MU_1) < 0.9, "both sides of the limits"


@pytest.mark.slow
@pytest.mark.parametrize("velocity_term", TERMS)
@pytest.mark.parametrize("law", LAWS)
def test_block_s_acceleration_is_the_force_over_the_mass(law, velocity_term):
    """The state seen by a robot with a heading of its own, through the ports."""
    state = random_states(2000, seed=2)
    block: Any = BLOCKS[law](
        gains=gains_of(law),
        velocity_term=velocity_term,
        attraction=AttractionParameters.model_validate(ATTRACTION),
    )
    at = Bench(block, target_valid=1.0, features=[2.0, 0.0, 0.0])
    theta = np.random.default_rng(3).uniform(-np.pi, np.pi, 2000)
    accelerations = []
    for k, heading in enumerate(theta):
        R = rotation(heading)
        at.set(
            p_WS_estimated=state["p_WS"][k],
            collision_vectors_B=np.append(R.T @ state["C"][k], np.zeros(4)),
            pose_WB_estimated=np.append(state["p_WP"][k] - R @ [EPSILON, 0.0], heading),
            v_WP=state["v_WP"][k],
        )
        at.state = [2.0, *state["before"][k], 0, 0, 0, 0, 0, 0]
        accelerations.append(at.output("acceleration_W"))
    expected = total_force(law, velocity_term, state, theta) / MASS
    np.testing.assert_allclose(accelerations, expected, atol=1e-9, rtol=0)


@pytest.mark.slow
@pytest.mark.parametrize("velocity_term", TERMS)
@pytest.mark.parametrize("law", LAWS)
def test_closed_loop_agrees_to_1e_6_over_40_s(law, velocity_term):
    follower = build_sound_follower(scenario(law, velocity_term))
    simulator = make_simulator(follower)
    simulator.Initialize()
    simulator.AdvanceTo(DURATION)
    context = simulator.get_context()
    command = follower.blocks["command"].GetMyContextFromRoot(context)

    state, velocity = integrate_independently(law, velocity_term)

    drake_state = context.get_continuous_state_vector().CopyToVector()
    np.testing.assert_allclose(drake_state, state, atol=1e-6, rtol=0)
    drake_velocity = command.get_discrete_state(0).CopyToVector()[:2]
    np.testing.assert_allclose(drake_velocity, velocity, atol=1e-6, rtol=0)
    assert np.linalg.norm(state[:2]) > 3.0, "the robot must have gone somewhere"


@pytest.mark.slow
def test_default_step_is_within_a_micrometer_of_a_fine_one():
    """What ``integration_step_s`` claims."""
    ends = []
    for step_s in (Scenario().integration_step_s, 0.0025):
        data = scenario("active").model_dump() | {"integration_step_s": step_s}
        follower = build_sound_follower(Scenario.model_validate(data))
        simulator = make_simulator(follower)
        simulator.Initialize()
        simulator.AdvanceTo(20.0)
        context = simulator.get_context()
        ends.append(context.get_continuous_state_vector().CopyToVector()[:3])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6, rtol=0)
