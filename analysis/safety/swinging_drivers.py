"""Drivers that swing to make the odometry drift, and then press against obstacles.

A driver is a program that commands a robot with a guard and tries to cause a collision.
To swing means to oscillate in forward speed and yaw rate. If the forward speed is in
phase with the angular acceleration, the odometry errors of successive control periods
can have the same sign. A driver of this module does the following:

1. It turns around once, and visits each box.
2. It returns to the start, and swings there for minutes.
3. It drives at the boxes again, and turns each front corner of the body toward them.

The driver steers by the true pose. It therefore finds the boxes even if the odometry
has drifted far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.safety.driver_trials import (
    AHEAD,
    AIM,
    SETTINGS,
    TWIST,
    Row,
    Trial,
    make_trial,
    outside,
    run_result,
)
from analysis.safety.falsification import evolve
from diagrams import RunResult
from systems.base.robot import RobotParameters
from systems.framework.signals import TICK_S

#: Lowest and highest frequency of random swings, Hz.
SLOWEST_HZ, FASTEST_HZ = 0.1, 10.0
#: Duration of a run in the search for drift, and in the search for a contact, s. The
#: second duration is enough to visit four boxes, to swing, and to press against them.
_DRIFT_S, _CONTACT_S = 48.0, 450.0
#: Position of the source, m. The drivers ignore it.
_SOURCE = 80.0, 0.0
#: Bearing of the body's front left corner from the axle, rad.
_CORNER = math.atan2(0.5 * RobotParameters().width_m, 0.5 * RobotParameters().length_m)


class Swing(NamedTuple):
    """Parameters of an oscillation of a driver's forward speed and yaw rate.

    ``wave`` in ``driver_trials`` defines its shape.
    """

    swing_v: float
    """Amplitude of the forward speed, m/s."""
    swing_omega: float
    """Amplitude of the yaw rate, rad/s."""
    hz: float
    """Frequency, Hz."""
    phase: float
    """Phase by which the yaw rate leads the forward speed, rad."""
    edge: float = 1.0
    """Argument ``edge`` of ``wave``; 1: not limited."""
    skew: float = 0.0
    """Argument ``skew`` of ``wave``; 0: not skewed."""

    def until(self, end_s: float) -> Row:
        """Makes a row of a driver's table: swing until the time ``end_s``, s."""
        v, omega, hz, *shape = self
        return Row(end_s, TWIST, 0, 0, 0, 0, 0, v, omega, math.tau * hz, *shape)


#: A swing that was found by hand. Up to a common shift of the time t, s, it is
#: v = 0.72 cos(20 t), m/s, and omega = 3.5 sin(20 t), rad/s.
BY_HAND = Swing(0.72, 3.5, 20.0 / math.tau, -0.5 * math.pi)


class _Script:
    """Builds the table of a driver, which is a list of timed commands."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.now_s = 0.0

    def add(self, seconds: float, row: Row) -> None:
        """Appends a row with the given duration, s."""
        self.now_s += seconds
        self.rows.append(row._replace(end_s=self.now_s))

    def look_around(self) -> None:
        """Adds a full turn in place."""
        self.add(8.0, Row(0.0, TWIST, 0.0, 0.9))

    def press(self, x: float, y: float) -> None:
        """Adds a drive to a point in W, m, and turns each front corner toward it."""
        goal = Row(0.0, x=x, y=y, by_truth=1.0)
        self.add(2.0 + math.hypot(x, y) / 0.4, goal._replace(mode=AHEAD, v=0.4))
        for bearing in (_CORNER, -_CORNER):
            self.add(1.0, goal._replace(mode=AHEAD, v=0.1))
            self.add(2.0, goal._replace(mode=AIM, omega=bearing))

    def home(self, heading: float, seconds: float) -> None:
        """Adds a drive to the start that may take ``seconds``, and a turn to a heading.

        The heading is in rad.
        """
        self.add(seconds, Row(0.0, AHEAD, 0.4, by_truth=1.0))
        x, y = 1e6 * math.cos(heading), 1e6 * math.sin(heading)
        self.add(2.0, Row(0.0, AIM, x=x, y=y, by_truth=1.0))


def swing_at_boxes(
    names: tuple[str, str, str],
    boxes: Sequence[Sequence[float]],
    swing: Swing,
    duration_s: float,
    *,
    heading: float = 0.0,
    swings: int = 4,
    swing_s: float = 10.0,
    presses: int = 1,
) -> Trial:
    """Makes a trial whose driver visits boxes, swings, and presses against the boxes.

    ``names`` are those of layout, driver and setting. A box is (x, y, theta, length,
    width) in W, m and rad. After the first visits, the driver repeats two actions until
    ``duration_s`` is over: it swings ``swings`` times for ``swing_s`` seconds each, and
    it presses against the next ``presses`` boxes. After each swing and each press, it
    returns to the start and turns to ``heading``, rad.
    """
    boxes, script, turn, home_s = outside(boxes), _Script(), 0, 4.0 + 0.03 * swing_s
    faces = [_nearest_point(box) for box in boxes]
    script.look_around()
    for face in faces:
        script.press(*face)
        script.home(heading, home_s)
    while script.now_s < duration_s:
        for _ in range(swings):
            script.add(swing_s, swing.until(0.0))
            script.home(heading, home_s)
        for _ in range(presses):
            script.press(*faces[turn % len(faces)])
            script.home(heading, home_s)
            turn += 1
    return make_trial(names, boxes, script.rows, heading, _SOURCE, 1, duration_s)


def _nearest_point(box: Sequence[float]) -> tuple[float, float]:
    """Point of a box that is nearest to the origin."""
    x, y, theta, length, width = box
    c, s = math.cos(theta), math.sin(theta)
    u = min(max(-c * x - s * y, -0.5 * length), 0.5 * length)
    v = min(max(s * x - c * y, -0.5 * width), 0.5 * width)
    return x + c * u - s * v, y + s * u + c * v


def swing_once(setting: str) -> Trial:
    """Makes a trial whose driver visits a box, swings once, and visits the box again.

    The swing lasts 80 s in the setting ``cells of 2 cm``, 40 s in the setting ``tick of
    50 ms``, and 150 s in all other settings. In this trial, a robot whose odometry
    approximates the arc of each control period by its chord touches the box.
    """
    names, box = ("box", "swing, by hand, once", setting), (0.0, -2.63, 0.0, 0.3, 0.3)
    swing_s = {"cells of 2 cm": 80.0, "tick of 50 ms": 40.0}.get(setting, 150.0)
    duration_s = 60.0 + swing_s
    return swing_at_boxes(names, [box], BY_HAND, duration_s, swings=1, swing_s=swing_s)


def swing_alone(swing: Swing, setting: str, duration_s: float) -> Trial:
    """Makes a trial whose driver turns around once, then swings on an empty floor.

    The whole trial lasts ``duration_s``.
    """
    names, script = ("empty", "swing", setting), _Script()
    script.look_around()
    script.add(duration_s, swing.until(0.0))
    return make_trial(names, [], script.rows, 0.0, _SOURCE, 1, duration_s)


#: Bounds of the parameters of a swing, in this order: forward speed, m/s; logarithm of
#: the yaw rate, rad/s; logarithm of the frequency, Hz; phase, rad; edge; skew.
_BOUNDS = (
    (0.02, 0.72),
    (math.log(1e-3), math.log(6.0)),
    (math.log(SLOWEST_HZ), math.log(FASTEST_HZ)),
    (-math.pi, math.pi),
    (1.0, 4.0),
    (-1.0, 1.0),
)


def draw_swing(draw: np.random.Generator) -> Swing:
    """Draws a random swing within the bounds ``_BOUNDS``."""
    return _swing_at(draw.uniform(size=len(_BOUNDS)))


def _swing_at(x: Any) -> Swing:
    """Converts a point of the unit cube to a swing within the bounds ``_BOUNDS``."""
    low, high = np.transpose(_BOUNDS)
    v, log_omega, log_hz, *shape = (low + (high - low) * np.asarray(x)).tolist()
    return Swing(v, math.exp(log_omega), math.exp(log_hz), *shape)


def _repeated(swing: Swing, setting: str) -> Swing:
    """Changes the period of a swing to a whole number of control periods.

    The rounding errors of the wheel encoders are then the same in each period of the
    swing, and add up.
    """
    tick_s = SETTINGS[setting].get("tick_s", TICK_S)
    period_s = tick_s * max(round(1.0 / (swing.hz * tick_s)), 2)
    return swing._replace(hz=1.0 / period_s)


def odometry_error(result: RunResult) -> NDArray[np.float64]:
    """Returns the (ticks,) errors of the odometry's position of the axle, m."""
    columns = result.columns
    x = columns["p_WB_x"] - columns["p_WB_estimated_x"]
    y = columns["p_WB_y"] - columns["p_WB_estimated_y"]
    return np.hypot(x, y)


def search_drift(setting: str, runs: int, seed: int) -> tuple[Swing, float]:
    """Searches by differential evolution for the swing with the largest odometry drift.

    The search takes about ``runs`` runs of 48 s each. Returns the swing, and its drift:
    the position error at the end of the run divided by the duration, m/s.
    """

    def drift(x: NDArray[np.float64]) -> float:
        swing = _repeated(_swing_at(x), setting)
        result = run_result(swing_alone(swing, setting, _DRIFT_S))
        return -float(odometry_error(result)[-1]) / result.simulated_s

    best = evolve(drift, [(0.0, 1.0)] * len(_BOUNDS), runs, seed)
    return _repeated(_swing_at(best.x), setting), -float(best.fun)


def four_boxes(distance_m: float) -> list[tuple[float, ...]]:
    """Places a box on each of the four sides of the start.

    A drift of the odometry in any direction then brings the robot near a box. Each box
    is (x, y, theta, length, width) in W, m and rad. ``distance_m`` is the distance of
    the box centers from the start.
    """
    sides = (0.0, -1.0), (0.0, 1.0), (1.0, 0.0), (-1.0, 0.0)
    return [(distance_m * x, distance_m * y, 0.0, 0.3, 0.3) for x, y in sides]


def search_contact(
    setting: str,
    runs: int,
    seed: int,
    judge: Callable[[Swing, RunResult], float],
) -> None:
    """Searches by differential evolution for a run that ends in a contact.

    The search takes about ``runs`` runs of 450 s each. It varies the heading, the
    distance of four boxes, and the swing. It minimizes the value that ``judge`` returns
    for the swing and the result of a run, such as the least clearance, m. The caller
    can record all runs in ``judge``.
    """
    names = "four boxes", "swing, searched for contact", setting

    def worth(x: NDArray[np.float64]) -> float:
        swing, heading, far = _swing_at(x[:-2]), math.tau * x[-2], 1.5 + 0.5 * x[-1]
        trial = swing_at_boxes(
            names, four_boxes(far), swing, _CONTACT_S, heading=heading, swings=6,
            swing_s=40.0, presses=4,
        )  # fmt: skip
        # If the robot never came near a body, the judged clearance is infinite. The
        # search needs a finite value.
        return min(judge(swing, run_result(trial)), 10.0)

    evolve(worth, [(0.0, 1.0)] * (len(_BOUNDS) + 2), runs, seed)
