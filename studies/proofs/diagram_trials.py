"""Simulates certified starts in the full diagram.

The certificate does not apply to the full diagram. There, the robot is a rectangle 0.82
m wide. Its sensors have conical beams, it hears bursts of sound, it has a control
period of 25 ms, and its motors have a lag.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.energy.certificate_trials import BATCH, draw_starts
from analysis.energy.energy_certificate import EnergyCertificate
from analysis.loops.diagram_state import set_discrete_state
from analysis.loops.ideal_scenarios import frozen_scenario, require_rolling
from analysis.report.intervals import Estimate, estimate_rate
from analysis.runs.contact import touching_point
from diagrams import (
    Scenario,
    SoundFollower,
    build_sound_follower,
    make_simulator,
)
from diagrams.running.monitor import Monitor
from diagrams.running.stop_rules import Collision
from diagrams.scenario.bodies import robot_rectangle
from systems.base.wheel_speed_command import hand_position_twist, limited_wheel_speeds
from systems.framework.input_error import InputError
from systems.world.geometry import control_point, rectangle_clearance, rotate


@dataclass(frozen=True, eq=False)
class DiagramTrials:
    """Results of the full diagram from certified starts."""

    starts: NDArray[np.float64]
    """(n, 4) x, y of control point P, m, and vx, vy, m/s.

    The robot faces along its velocity.
    """
    causes: tuple[str, ...]
    """Cause of the end of each run."""
    mechanisms: tuple[str, ...]
    """Side of each collision: ahead, beside or behind; empty without a collision."""
    skipped: int
    """Number of certified starts at which the rectangle already overlaps a body."""

    @property
    def collisions(self) -> int:
        """Number of runs that ended in a collision."""
        return self.causes.count("collision")

    @property
    def collision_rate(self) -> Estimate:
        """Share of the runs that ended in a collision."""
        return estimate_rate(self.collisions, len(self.causes))

    def to_dict(self) -> dict[str, Any]:
        """Converts the result to plain values for the JSON document."""
        return {
            "runs": len(self.causes),
            "collisions": self.collisions,
            "collision_rate": asdict(self.collision_rate),
            "causes": dict(Counter(self.causes)),
            "mechanisms": dict(Counter(m for m in self.mechanisms if m)),
            "skipped": self.skipped,
        }


def try_diagram(
    certificate: EnergyCertificate,
    *,
    starts: int = 24,
    hearing: str = "ideal",
) -> DiagramTrials:
    """Runs the scenario's diagram from random certified starts.

    As in the certificate, source and obstacles rest where they are at 0 s. The starts
    are those of ``try_certificate``, without starts at which the rectangle overlaps a
    body.

    Args:
        certificate: Certificate whose starts are used.
        starts: Number of runs.
        hearing: ``ideal`` for bursts of exact positions, or ``audio``. A run with
            ``audio`` takes about a second.

    Returns:
        Starts of control point P, and how each run ended.

    Raises:
        InputError: Too few starts are certified, the wheels can slip, or ``starts`` is
            below 1.
    """
    require_rolling(certificate.scenario.only.plant)
    if starts < 1:
        raise InputError("starts", f"{starts} must be at least 1")
    scenario = frozen_scenario(certificate.scenario)
    scenario = scenario.with_robot(hearing=hearing)
    follower = build_sound_follower(scenario)
    states, poses, skipped = _certified_starts(certificate, scenario, starts)
    ends = [_run(follower, *start) for start in zip(states, poses, strict=True)]
    causes, mechanisms = zip(*ends, strict=True)
    return DiagramTrials(states, causes, mechanisms, skipped)


def _certified_starts(
    certificate: EnergyCertificate, scenario: Scenario, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Draws (n, 4) starts and their (n, 3) poses, and counts skipped starts."""
    rng = np.random.default_rng(scenario.seed)
    states = draw_starts(certificate, BATCH, rng)
    states = states[certificate.certified(states)]
    around = scenario.bodies().values()
    bodies = [row for body in around for row in body.rectangles(0.0)]
    kept, poses, skipped = [], [], 0
    for state in states:
        pose = _pose(state, scenario)
        footprint = robot_rectangle(pose, scenario.only.robot)
        if min(rectangle_clearance(footprint, body) for body in bodies) <= 0.0:
            skipped += 1
            continue
        kept.append(state)
        poses.append(pose)
        if len(kept) == count:
            break
    if len(kept) < count:
        raise InputError(
            "starts",
            f"only {len(kept)} of {BATCH} random starts are certified and clear of "
            f"all bodies; use fewer than {count} starts",
        )
    return np.array(kept), np.array(poses), skipped


def _pose(state: NDArray[np.float64], scenario: Scenario) -> NDArray[np.float64]:
    """Pose of a robot with P at the start, facing along its velocity."""
    theta = math.atan2(state[3], state[2])
    offset = scenario.only.robot.control_point_m
    x, y = state[:2] - offset * np.array([math.cos(theta), math.sin(theta)])
    return np.array([x, y, theta])


def _run(
    follower: SoundFollower, state: NDArray[np.float64], pose: NDArray[np.float64]
) -> tuple[str, str]:
    """Runs one start, and returns the cause of its end and the side of a collision."""
    scenario, robot = follower.scenario, follower.scenario.only.robot
    simulator = make_simulator(follower)
    monitor = Monitor(follower)
    simulator.set_monitor(monitor)
    contexts = {
        role: follower.blocks[role].GetMyMutableContextFromRoot(
            simulator.get_mutable_context()
        )
        for role in ("plant", "odometry", "command")
    }
    velocity = state[2:].tolist()
    v, omega = hand_position_twist(velocity, pose[2], robot.control_point_m)
    wheels = limited_wheel_speeds(v, omega, robot)
    contexts["plant"].SetContinuousState([*pose, 0.0, 0.0, *wheels])
    contexts["odometry"].SetDiscreteState([*pose, 0.0, 0.0])
    set_discrete_state(contexts["command"], [*velocity, *wheels])
    simulator.Initialize()
    simulator.AdvanceTo(scenario.duration_s)
    (name,) = follower.robots
    collision = monitor.referee.collision(name)
    if collision is None:
        return monitor.referee.cause_of(name), ""
    end = contexts["plant"].get_continuous_state_vector().CopyToVector()[:3]
    return "collision", _mechanism(scenario, end, collision)


def _mechanism(
    scenario: Scenario, pose: NDArray[np.float64], collision: Collision
) -> str:
    """Side of a contact: in the beams ahead of P, beside the robot, or behind."""
    (body,) = scenario.bodies()[collision.object].rectangles(collision.time)
    point = touching_point(robot_rectangle(pose, scenario.only.robot), body)
    p_WP = control_point(pose, scenario.only.robot.control_point_m)
    x, y = rotate(-pose[2], point[0] - p_WP[0], point[1] - p_WP[1])
    sensors = scenario.follower.ultrasonic.sensors
    fan = max(abs(each.axis_deg) + each.beam_half_angle_deg for each in sensors)
    if abs(math.degrees(math.atan2(y, x))) <= fan:
        return "ahead"
    x_B = x + scenario.only.robot.control_point_m
    at_an_end = (
        abs(y) / scenario.only.robot.width_m >= -x_B / scenario.only.robot.length_m
    )
    return "beside" if at_an_end else "behind"
