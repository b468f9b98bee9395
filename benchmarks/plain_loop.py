"""The default chain as a plain loop over the blocks' pure functions.

What a user would write without a block diagram: same functions, same order,
same integrator, no ports, no caching, no contexts. It serves as the yardstick
of the diagram's overhead and, in ``tests/evals``, as its double.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams import Scenario
from diagrams.building.robot import block_seed
from systems.base.diff_drive_plant import (
    PlantNumbers,
    advance,
    body_twist,
    plant_derivatives,
)
from systems.base.lagged_motion import advance_pose, lagged_motion
from systems.base.robot import microphones_B
from systems.base.wheel_odometry import encoder_angle
from systems.base.wheel_speed_command import (
    hand_position_twist,
    integrate_velocity,
    limited_wheel_speeds,
)
from systems.framework.noise import standard_normals
from systems.framework.signals import TICK_S
from systems.hearing.source_fix import SourceFix
from systems.hearing.tdoa_estimator import port_values, robot_localizer
from systems.hearing.tracking.tracker_model import (
    blank_track,
    track_step,
    tracker_numbers,
)
from systems.laws.active import active_force
from systems.laws.impedance_controller import (
    attraction_force,
    obstacle_speed,
    repulsion_force,
)
from systems.ranging.collision_vector import collision_vectors, echo_points
from systems.ranging.ultrasonic_array import (
    cone_ranges,
    measured_ranges,
    range_errors,
    world_rectangles,
)
from systems.sound.real_array import no_errors, real_array
from systems.sound.recorder import record_frame
from systems.sound.sound_emitter import MAXIMUM_RANGE_M, history_ticks, make_emission
from systems.sound.waveforms import make_waveform
from systems.world.geometry import control_point, rotate

T = TICK_S


class PlainLoop:
    """The default scenario's chain; ``run`` returns the plant's states."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        c = scenario.sound_speed_m_s
        self.path = scenario.source.path()
        self.obstacles = [o.path() for o in scenario.obstacles]
        rows = [row for o in scenario.obstacles for row in o.shape().rectangles]
        self.sizes = np.array([extent for row in rows for extent in row[3:]])
        seed = block_seed(scenario.seed, "sound_emitter")
        self.waveform = make_waveform(scenario.source.sound, seed)
        self.ticks = history_ticks(MAXIMUM_RANGE_M, c)
        self.mic_seed = block_seed(scenario.seed, "mic_array")
        microphones = scenario.follower.microphones
        errors = no_errors(len(scenario.only.robot.microphones_m))
        p_BM = microphones_B(scenario.only.robot)
        self.array = real_array(p_BM, microphones, errors, c)
        self.tracker = tracker_numbers(
            scenario.follower.tracker, scenario.only.robot, 1.5 * T
        )
        self.ultrasonic_seed = block_seed(scenario.seed, "ultrasonic_array")
        self.localizer, self.p_PA_B = robot_localizer(
            scenario.follower.tdoa, scenario.only.robot, c
        )

    def run(self) -> NDArray[np.float64]:
        """(ticks + 1, 7) states of the plant at every tick."""
        scenario = self.scenario
        self.memory = self.localizer.blank()
        state = [*scenario.only.start.pose, 0.0, 0.0, 0.0, 0.0]
        odometry, angles = list(scenario.only.start.pose), [0.0, 0.0]
        self.track = blank_track(self.tracker, odometry)
        v_WP: tuple[float, float] = (0.0, 0.0)
        wheels: tuple[float, float] = (0.0, 0.0)
        fix: SourceFix | None = None
        before: dict[int, list[float]] = {}
        x, y, _ = self.path.pose(0.0)
        history = np.zeros((2, self.ticks + 1, 2))
        history[0] = x, y
        last = (np.array(state[:3]), np.zeros(3))
        states = [state]
        for tick in range(round(scenario.duration_s / T)):
            time = tick * T
            odometry, angles = self._odometry(odometry, angles, state[3:5], wheels)
            target, valid = self._target(tick, fix, odometry)
            vectors = self._obstacles(time, tick, state, odometry[2])
            acceleration = self._law(odometry, v_WP, target, valid, vectors, before)
            before = {round(row[0]): row[1:] for row in vectors}
            v_WP = integrate_velocity(
                v_WP, acceleration, T, scenario.only.robot.top_speed_m_s
            )
            v, omega = hand_position_twist(
                v_WP, odometry[2], scenario.only.robot.control_point_m
            )
            fix, last = self._listen(time, state, history, last)
            wheels = limited_wheel_speeds(v, omega, scenario.only.robot)
            state = self._drive(state, wheels)
            states.append(state)
        return np.array(states)

    def _odometry(self, pose: Any, angles: Any, true_angles: Any, wheels: Any) -> Any:
        pulses = self.scenario.only.plant.pulses_per_revolution
        assert pulses is not None
        now = [encoder_angle(angle, pulses) for angle in true_angles]
        steps = (now[0] - angles[0], now[1] - angles[1])
        robot = self.scenario.only.robot
        steady = body_twist((T * wheels[0], T * wheels[1]), robot)
        motion = lagged_motion(T, self.scenario.only.plant.motor_lag_s)
        return list(advance_pose(pose, body_twist(steps, robot), steady, motion)), now

    def _target(self, tick: int, fix: Any, pose: Any) -> Any:
        estimate = port_values(fix, self.p_PA_B)[2:6]
        outputs = tuple(np.zeros(size) for size in (2, 2, 4, 1, 1))
        inputs = (*estimate, np.array(pose))
        track_step(tick, self.track, inputs, outputs, self.tracker)
        return outputs[0], outputs[4][0] > 0.5

    def _obstacles(self, time: Any, tick: Any, state: Any, theta: Any) -> Any:
        scenario = self.scenario
        poses = np.array([v for path in self.obstacles for v in path.pose(time)])
        rectangles = world_rectangles(
            poses, self.sizes, self.path.pose(time), scenario.source_size
        )
        true = cone_ranges(
            state[:3],
            rectangles,
            scenario.follower.ultrasonic,
            scenario.only.robot.control_point_m,
        )
        ranges, echo = measured_ranges(
            true,
            standard_normals(
                (2, scenario.follower.ultrasonic.count), self.ultrasonic_seed, tick
            ),
            range_errors(scenario.follower.ultrasonic),
        )
        points = echo_points(
            ranges.tolist(), echo.tolist(), scenario.follower.ultrasonic
        )
        vectors = collision_vectors(
            points,
            scenario.follower.collision_vector,
            scenario.follower.ultrasonic.neighbors,
        )
        return [[feature, *rotate(theta, x, y)] for feature, x, y in vectors]

    def _law(
        self, pose: Any, v_WP: Any, target: Any, valid: Any, vectors: Any, before: Any
    ) -> Any:
        scenario = self.scenario
        p_WP = control_point(pose, scenario.only.robot.control_point_m)
        mass = scenario.only.robot.mass_kg
        F_m = attraction_force(
            p_WP, v_WP, target, valid, scenario.follower.attraction, mass
        )
        closing = scenario.follower.collision_vector.velocity_term == "closing"
        gains = (scenario.follower.laws.active,)
        Fx = Fy = 0.0
        for feature, *C_W in vectors:
            C_before = before.get(round(feature))
            s = 0.0
            if C_before is not None:
                s = obstacle_speed(C_W, C_before, closing, T)
            fx, fy = repulsion_force(C_W, s, active_force, gains)
            Fx, Fy = Fx + fx, Fy + fy
        return (F_m[0] + Fx) / mass, (F_m[1] + Fy) / mass

    def _listen(self, time: Any, state: Any, history: Any, last: Any) -> Any:
        scenario = self.scenario
        x, y, _ = self.path.pose(time)
        vx, vy, _ = self.path.velocity(time)
        history[0, -1], history[1, -1] = (x, y), (vx, vy)
        v, omega = body_twist(state[5:], scenario.only.robot)
        theta = state[2]
        velocity = np.array([v * np.cos(theta), v * np.sin(theta), omega])
        now = (np.array(state[:3]), velocity)
        emission = make_emission(
            time, self.waveform, scenario.source.sound, *history.copy()
        )
        audio = record_frame(
            [emission],
            time,
            last,
            now,
            self.array,
            parameters=scenario.follower.microphones,
            seed=self.mic_seed,
        )
        history[:, :-1] = history[:, 1:]
        fix, self.memory = self.localizer.localize(audio.counts, self.memory)
        return fix, now

    def _drive(self, state: Any, wheels: Any) -> Any:
        """The steps of the scenario's integrator, those that Drake takes."""
        numbers = PlantNumbers.of(self.scenario.only.robot, self.scenario.only.plant)
        commanded, moved = np.array(wheels), np.array(state)
        step_s = self.scenario.integration_step_s
        for _ in range(round(T / step_s)):
            advance(moved, step_s, commanded, plant_derivatives, numbers)
        return moved.tolist()
