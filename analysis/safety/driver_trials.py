"""Trials in which a driver tries to make a robot with a guard touch obstacles at rest.

A driver is a law or another program that commands the robot. A layout is a random
arrangement of obstacles. A setting, also called a variant, is a set of changes of the
robot's parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from diagrams import RunResult, Scenario, simulate
from systems.framework.block import Block, Port, RunFacts, Step
from systems.framework.compiling import njit
from systems.framework.signals import TICK_S
from systems.safety.parameters import START_BUBBLE_M
from systems.world.geometry import beyond_rectangle, rectangle_clearance

#: Duration of a run, s.
DURATION_S = 10.0
#: Number of obstacles in every trial. Obstacles that a layout does not need are far
#: away.
_BODIES = 6
#: Modes of a row of a driver's table; see ``Row.mode``.
TWIST, AHEAD, BACK, AIM = range(4)


class Row(NamedTuple):
    """A row of a driver's table: the driver's command until a given time.

    The command is the sum of the command of the mode and a swing. The swing of the
    forward speed is ``swing_v * wave(rate * t)``. The swing of the yaw rate is
    ``swing_omega * wave(rate * t + phase)``. The time t is that of the run.
    """

    end_s: float
    """Time at which the row ends, s. ``make_trial`` converts it to control periods."""
    mode: float = TWIST
    """Mode of the driver.

    - ``TWIST``: Command ``v`` and ``omega``.
    - ``AHEAD``: Drive forward to the goal with ``v``, and add the yaw rate ``omega``.
    - ``BACK``: Drive backward to the goal with ``v``, and add the yaw rate ``omega``.
    - ``AIM``: Turn in place until the goal is at the bearing ``omega``.
    """
    v: float = 0.0
    """Forward speed, m/s. In the mode ``BACK``: speed backward, m/s."""
    omega: float = 0.0
    """Yaw rate, rad/s. In the mode ``AIM``: a bearing, rad."""
    x: float = 0.0
    """x of the goal in W, m."""
    y: float = 0.0
    """y of the goal in W, m."""
    by_truth: float = 0.0
    """1: the driver steers by the true pose. 0: the driver steers by the odometry."""
    swing_v: float = 0.0
    """Amplitude of the swing of the forward speed, m/s."""
    swing_omega: float = 0.0
    """Amplitude of the swing of the yaw rate, rad/s."""
    rate: float = 0.0
    """Angular frequency of the swing, rad/s. ``make_trial`` converts it to rad per
    control period."""
    phase: float = 0.0
    """Phase by which the swing of the yaw rate leads that of the forward speed, rad."""
    edge: float = 1.0
    """Shape of the swing: argument ``edge`` of ``wave``."""
    skew: float = 0.0
    """Shape of the swing: argument ``skew`` of ``wave``."""


_FIELDS = len(Row._fields)
#: Table of the driver in the next run. ``run_result`` sets it, because a scenario can
#: name the block ``Driver`` but cannot pass a table to it.
_NEXT: list[NDArray[np.float64]] = [np.array(Row(0.0))]


@register_jitable
def wave(angle: float, edge: float, skew: float) -> float:
    """Returns a periodic function of a phase angle in rad, with values from -1 to 1.

    With an ``edge`` of 1 and a ``skew`` of 0, the function is a sine. ``edge`` is a
    gain, after which the value is limited to [-1, 1]. A large gain makes a square wave.
    A ``skew`` near 1 or -1 makes a sawtooth.
    """
    value = edge * math.sin(angle + skew * math.sin(angle))
    return min(max(value, -1.0), 1.0)


def drive_step(tick: int, state: Any, inputs: Any, outputs: Any, numbers: Any) -> None:
    """Step function of ``Driver``: commands a twist by the present row of the table."""
    (believed, true), (twist,), (table,) = inputs, outputs, numbers
    row = 0
    while row + _FIELDS < len(table) and tick > table[row]:
        row += _FIELDS
    mode, v, omega, x, y, by_truth = table[row + 1 : row + 7]
    swing_v, swing_omega, rate, phase, edge, skew = table[row + 7 : row + 13]
    if mode > 0.5:
        pose = true if by_truth > 0.5 else believed
        toward = math.atan2(y - pose[1], x - pose[0])
        if mode > 2.5:
            toward, v, omega = toward - omega, 0.0, 0.0
        elif mode > 1.5:
            toward, v = toward + math.pi, -v
        off = (toward - pose[2] + math.pi) % math.tau - math.pi
        omega += min(max(4.0 * off, -3.0), 3.0)
        v *= max(math.cos(off), 0.0)
    angle = rate * tick
    twist[0] = v + swing_v * wave(angle, edge, skew)
    twist[1] = omega + swing_omega * wave(angle + phase, edge, skew)


class Driver(Block):
    """A block that commands the robot by a table and does not react to obstacles.

    The block replaces the control law. Unlike a law, it can use the true pose: rows
    with ``by_truth`` steer by it.
    """

    part = "controller"
    inputs = (
        Port("pose_WB_estimated", 3, "m, m, rad"),
        Port("pose_WB", 3, "m, m, rad"),
    )
    outputs = (Port("twist_B", 2, "m/s, rad/s"),)

    def __init__(self, *, tick_s: float) -> None:
        super().__init__()
        self.set_name("driver")
        self.declare(Step(drive_step, (_NEXT[0],)), tick_s=tick_s)

    def step_for(self, run: RunFacts) -> Step:
        """Returns the step function with the table of the run."""
        return Step(drive_step, (_NEXT[0],))


class Trial(NamedTuple):
    """Description of a run in which a driver tries to cause a collision."""

    layout: str
    """Name of the layout."""
    driver: str
    """Name of the driver or law."""
    variant: str
    """Name of the setting."""
    fields: dict[str, Any]
    """Fields of the scenario."""
    table: NDArray[np.float64]
    """Table of the driver: the fields of all ``Row`` objects in one array. If a law
    drives, the table is not used."""


class Outcome(NamedTuple):
    """Result of a trial."""

    collided: bool
    """Whether the robot touched an obstacle."""
    clearance_m: float
    """Least clearance of the body, m."""


#: Settings of the robot from which ``draw_trial`` selects, by name. Each setting is a
#: set of changed fields of the scenario.
VARIANTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "no noise": {"ultrasonic": {"noise_m": 0.0}},
    "noise of 1 cm": {"ultrasonic": {"noise_m": 0.01}},
    "ring of 12": {"ultrasonic": {"sensors": 12}},
    "36 narrow beams": {"ultrasonic": {"sensors": 36, "beam_half_angle_deg": 5.0}},
    "in turn": {"ultrasonic": {"firing": "sequential"}},
    "tick of 12.5 ms": {"tick_s": 0.0125},
    "tick of 50 ms": {
        "tick_s": 0.05,
        "microphones": {"frame_s": 0.05},
        "ultrasonic": {"period_s": 0.05},
    },
    "lag of 150 ms": {"plant": {"motor_lag_s": 0.15}},
    "braking of 0.6": {"guard": {"braking_m_s2": 0.6}},
    "slip apart": {
        "plant": {"slip": (0.005, -0.005)},
        "guard": {"wheel_error": 0.005, "place_error_m": 0.03},
    },
    "slip alike": {
        "plant": {"slip": (-0.005, -0.005)},
        "guard": {"wheel_error": 0.005, "place_error_m": 0.03},
    },
    "cells of 2 cm": {"guard": {"cell_m": 0.02}},
}
#: All settings. ``draw_trial`` uses those that are not in ``VARIANTS`` only if its
#: argument ``setting`` names them.
SETTINGS = {
    **VARIANTS,
    "encoders not rounded": {"plant": {"pulses_per_revolution": None}},
    "slip apart, known to 10 cm": {
        "plant": {"slip": (0.005, -0.005)},
        "guard": {"wheel_error": 0.005, "place_error_m": 0.1},
    },
    "encoders of 650 pulses": {"plant": {"pulses_per_revolution": 650}},
}


def _box(
    x: float, y: float, theta: float, length: float, width: float
) -> tuple[float, ...]:
    return x, y, theta, length, width


def _posts(draw: np.random.Generator) -> list[tuple[float, ...]]:
    angle = draw.uniform(-math.pi, math.pi, _BODIES)
    far = START_BUBBLE_M + 0.015 + draw.exponential(0.5, _BODIES)
    return [
        _box(r * math.cos(a), r * math.sin(a), 0.0, 0.02, 0.02)
        for r, a in zip(far, angle, strict=True)
    ]


def _slit(draw: np.random.Generator) -> list[tuple[float, ...]]:
    gap, thick = draw.uniform(0.78, 1.05), draw.uniform(0.02, 0.4)
    angle, tilt = draw.uniform(-math.pi, math.pi), draw.normal(0.0, 0.3)
    far, aside = START_BUBBLE_M + draw.uniform(0.1, 0.8), draw.normal(0.0, 0.1)
    boxes = []
    for side in (1.0, -1.0):
        along = aside + side * (0.5 * gap + 0.75)
        c, s = math.cos(angle + tilt), math.sin(angle + tilt)
        x, y = far * math.cos(angle) - along * s, far * math.sin(angle) + along * c
        boxes.append(_box(x, y, angle + tilt, thick, 1.5))
    return boxes


def _wedge(draw: np.random.Generator) -> list[tuple[float, ...]]:
    angle, half = draw.uniform(-math.pi, math.pi), draw.uniform(0.3, 1.1)
    far, boxes = START_BUBBLE_M + draw.uniform(0.2, 1.2), []
    for side in (half, -half):
        toward = angle + math.pi + side
        x = far * math.cos(angle) + 1.0 * math.cos(toward)
        y = far * math.sin(angle) + 1.0 * math.sin(toward)
        boxes.append(_box(x, y, toward, 2.0, 0.05))
    return boxes


def _walls(draw: np.random.Generator) -> list[tuple[float, ...]]:
    boxes = []
    for angle in draw.uniform(-math.pi, math.pi, int(draw.integers(1, 4))):
        far = START_BUBBLE_M + 0.0505 + abs(draw.normal(0.0, 0.2))
        boxes.append(_box(far * math.cos(angle), far * math.sin(angle), angle, 0.1, 3))
    return boxes


def _bubble(draw: np.random.Generator) -> list[tuple[float, ...]]:
    """Boxes near the edge of the start bubble, with corners or faces toward it.

    The start bubble is the circle about the start that the guard assumes to be free.
    """
    boxes = []
    for angle in draw.uniform(-math.pi, math.pi, _BODIES):
        length, width = draw.uniform(0.02, 0.3, 2)
        boxes.append(
            _box(
                (START_BUBBLE_M + length) * math.cos(angle),
                (START_BUBBLE_M + length) * math.sin(angle),
                angle + draw.choice([0.0, math.pi / 4.0]),
                length,
                width,
            )
        )
    return boxes


def _corner(draw: np.random.Generator) -> list[tuple[float, ...]]:
    """Two perpendicular walls that meet at a random point."""
    angle, far = (
        draw.uniform(-math.pi, math.pi),
        START_BUBBLE_M + draw.uniform(0.05, 0.6),
    )
    turn = draw.uniform(-math.pi, math.pi)
    x, y = far * math.cos(angle), far * math.sin(angle)
    return [
        _box(x + 0.75 * math.cos(way), y + 0.75 * math.sin(way), way, 1.5, 0.03)
        for way in (turn, turn + math.pi / 2.0)
    ]


LAYOUTS = {
    "posts": _posts,
    "slit": _slit,
    "wedge": _wedge,
    "walls": _walls,
    "against the bubble": _bubble,
    "corner": _corner,
}


def _random(draw: np.random.Generator, boxes: Any, seconds: float) -> list[list[float]]:
    """Random commands of speed and yaw rate that last for random times."""
    rows, end = [], 0.0
    while end < seconds:
        end += draw.exponential(1.5)
        v, omega = draw.uniform(-0.72, 0.72), draw.normal(0.0, 1.5)
        rows.append([end, TWIST, v, omega, 0.0, 0.0])
    return rows


def _pressing(
    draw: np.random.Generator, boxes: Any, seconds: float
) -> list[list[float]]:
    """Drives at a random box or near it, forward or backward, for 5 s to 10 s each."""
    rows, end = [], 0.0
    while end < seconds:
        x, y = boxes[int(draw.integers(len(boxes)))][:2]
        way, off = draw.uniform(0.5, 1.0), draw.normal(0.0, 0.3, 2)
        end += draw.uniform(5.0, DURATION_S)
        doing = draw.choice([AHEAD, BACK])
        v, omega = draw.uniform(0.02, 0.72), draw.choice([0.0, draw.normal(0.0, 0.7)])
        rows.append([end, doing, v, omega, way * x + off[0], way * y + off[1]])
    return rows


def _looking(
    draw: np.random.Generator, boxes: Any, seconds: float
) -> list[list[float]]:
    """Turns first, so that the sensors see the surroundings, then drives at boxes."""
    turn = draw.choice([-1.0, 1.0]) * draw.uniform(1.0, 3.0)
    rows = [[draw.uniform(1.0, 4.0), TWIST, 0.0, turn, 0.0, 0.0]]
    return [*rows, *_pressing(draw, boxes, seconds)]


DRIVERS = {"random": _random, "pressing": _pressing, "looking": _looking}
_LAWS = ("active", "conventional")


def outside(boxes: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Moves boxes outward until none overlaps the circle of radius 1 m about the start.

    A box is (x, y, theta, length, width) in W, m and rad. The start is at the origin.
    Each returned box is at least 0.1 mm outside the circle.
    """
    moved = []
    for x, y, *rest in boxes:
        far, step = math.hypot(x, y), 0
        while True:
            stretch = 1.0 + 0.002 * step / far
            box = x * stretch, y * stretch, *rest
            away = math.hypot(*beyond_rectangle((0.0, 0.0), (*box, 0.0)))
            if away >= START_BUBBLE_M + 1e-4:
                break
            step += 1
        moved.append(box)
    return moved


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if nested else value
    return result


def make_trial(
    names: tuple[str, str, str],
    boxes: Sequence[Sequence[float]],
    rows: Sequence[Sequence[float]],
    heading: float,
    source: tuple[float, float],
    seed: int,
    duration_s: float = DURATION_S,
) -> Trial:
    """Makes a trial from boxes and commands.

    ``names`` are those of layout, driver and setting. A box is (x, y, theta, length,
    width) in W, m and rad. ``outside`` moves boxes that are too near to the start.
    ``rows`` have the first fields of ``Row``, or all of them. If there are no rows, the
    law with the name of the driver controls the robot. ``heading`` is that at the
    start, rad. ``source`` is the position of the source in W, m.
    """
    layout, driver, variant = names
    boxes = outside(boxes)
    boxes += [(30.0 + k, 30.0, 0.0, 0.1, 0.1) for k in range(_BODIES - len(boxes))]
    fields = {
        "name": "falsification",
        "law": "analysis.safety.driver_trials:Driver" if rows else driver,
        "hearing": "ideal",
        "seed": seed,
        "duration_s": duration_s,
        "start": {"heading_deg": math.degrees(heading)},
        "source": {"waypoints_m": [source]},
        "obstacles": [
            {
                "name": f"box {k}",
                "waypoints_m": [(x, y)],
                "heading_deg": math.degrees(theta),
                "size_m": (length, width),
            }
            for k, (x, y, theta, length, width) in enumerate(boxes)
        ],
        "stop": {
            "stuck_after_s": 1e4,
            "lost_after_s": 1e4,
            "rest_time_s": 1e4,
            "diverged_range_m": 1e3,
        },
        "guard": {"obstacle_speed_m_s": 0.0},
    }
    fields = _merged(fields, SETTINGS[variant])
    table = np.array([Row(*row) for row in rows] or [Row(0.0)], dtype=float)
    tick_s = fields.get("tick_s", TICK_S)
    table[:, Row._fields.index("end_s")] /= tick_s
    table[:, Row._fields.index("rate")] *= tick_s
    return Trial(layout, driver, variant, fields, table.ravel())


#: Drivers to draw from. Drivers with a table appear twice, laws once.
USUAL = (*DRIVERS, *DRIVERS, *_LAWS)


def draw_trial(
    seed: int,
    number: int,
    drivers: Sequence[str] = USUAL,
    setting: str | None = None,
    duration_s: float = DURATION_S,
) -> Trial:
    """Draws a random trial. The same arguments give the same trial.

    The driver is one of ``drivers``, which are names of ``DRIVERS`` or of laws. Without
    a ``setting``, the number of the trial selects one of ``VARIANTS``.
    """
    draw = np.random.default_rng([seed, number])
    layout = str(draw.choice([*LAYOUTS]))
    driver = str(draw.choice([*drivers]))
    # 200 successive trials have the same setting. Each setting needs its own blocks,
    # and Drake never frees blocks.
    variant = setting or [*VARIANTS][number // 200 % len(VARIANTS)]
    boxes = LAYOUTS[layout](draw)
    angle = math.atan2(boxes[0][1], boxes[0][0]) + draw.normal(0.0, 0.3)
    far = 8.0 if driver in DRIVERS else draw.uniform(2.5, 3.5)
    source = far * math.cos(angle), far * math.sin(angle)
    rows = DRIVERS[driver](draw, boxes, duration_s) if driver in DRIVERS else []
    heading = angle + draw.choice([0.0, draw.uniform(-math.pi, math.pi)])
    names = layout, driver, variant
    noise = int(draw.integers(1 << 30))
    return make_trial(names, boxes, rows, heading, source, noise, duration_s)


def run_trial(trial: Trial, changes: dict[str, Any] | None = None) -> Outcome:
    """Runs a trial and returns its outcome. ``changes`` are those of ``run_result``."""
    result = run_result(trial, changes)
    return Outcome(result.collision is not None, least_clearance(result))


def run_result(trial: Trial, changes: dict[str, Any] | None = None) -> RunResult:
    """Runs a trial. ``changes`` replace fields of its scenario before the run."""
    _NEXT[0] = trial.table
    fields = _merged(trial.fields, changes or {})
    return simulate(Scenario.model_validate(fields), engine="compiled")


def least_clearance(result: RunResult) -> float:
    """Computes the least distance of the body from the obstacles during a run, m.

    A negative distance means an overlap. The obstacles must be at rest. The true poses
    of the robot are evaluated at the control updates and halfway between them.
    """
    robot = result.scenario.only.robot
    others = result.surroundings.bodies.values()
    boxes = np.concatenate([body.rectangles(0.0) for body in others])
    size = np.array([robot.length_m, robot.width_m])
    poses = np.ascontiguousarray(result.poses("WB"))
    return float(_least(poses, boxes, size))


@njit(cache=True)
def _least(poses: Any, boxes: Any, size: Any) -> float:  # pragma: no cover  (compiled)
    mine, body = np.zeros(6), np.inf
    mine[3:5] = size
    for box in boxes:
        reach = 0.5 * math.hypot(box[3], box[4]) + box[5] + 1.0
        for k in range(len(poses)):
            if math.hypot(poses[k, 0] - box[0], poses[k, 1] - box[1]) > reach:
                continue
            for half in range(2):
                mine[:3] = poses[k]
                if half == 1 and k > 0:
                    mine[:3] = 0.5 * (poses[k] + poses[k - 1])
                body = min(body, rectangle_clearance(mine, box))
    return body
