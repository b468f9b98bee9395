"""Computes which objects a picture shows, and where they are at a given time."""

from __future__ import annotations

import math
import textwrap
from itertools import cycle
from typing import NamedTuple

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray

from analysis.reporting.palette import COLOURS, ROBOT_COLOURS
from diagrams import RunResult, Scenario
from diagrams.running.stop_rules import SUCCESSFUL
from diagrams.scenario.bodies import Path, robot_rectangle
from diagrams.scenario.participants import HasRangeSensors
from systems.framework.input_error import InputError
from systems.sound.parameters import SoundParameters
from systems.world.geometry import nearest_point_on_rectangle, rectangle_corners, rotate
from systems.world.parameters import ObstacleParameters

#: Intervals between times of a picture, s. A reader can count easily with these values.
_NICE_PERIODS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0)

#: Largest number of characters per line of a title.
LONGEST_LINE = 80


def tick_at(result: RunResult, time: float) -> int:
    """Returns the number of the tick (control period) that is nearest to a given time.

    Args:
        result: Result of the run.
        time: Time, s. For a time outside the run, the function returns the first or the
            last tick.

    Returns:
        Row of the table ``trajectory``, counted from 0.
    """
    return int(np.argmin(np.abs(result.time - time)))


def picture_times(result: RunResult, most: int = 10) -> NDArray[np.float64]:
    """Returns times at constant intervals, starting at 0.

    Args:
        result: Result of the run.
        most: Largest number of times; at least 2.

    Returns:
        (n,) ascending times, s.
    """
    end = result.simulated_s
    period = next((p for p in _NICE_PERIODS_S if end / p < most), end / (most - 1))
    return np.arange(0.0, end + 1e-9, period)


class Look(NamedTuple):
    """Colors and labels of one robot in pictures."""

    result: RunResult
    """Result of the run, for this robot."""
    colour: str
    """Color of the robot's path and body."""
    estimates: str
    """Color of the source positions that the robot estimates."""
    path_label: str = "path of the control point P"
    body_label: str = "robot with its microphones"
    """Label of the body. It is empty if the color of the path identifies the body."""
    estimates_label: str = "estimates of the source; faint ones are early"
    seen: str = COLOURS["seen"]
    """Color of the floor that the robot knows to be free. Pictures lighten this
    color."""
    echoes: str = COLOURS["echoes"]
    """Color of the positions from which echoes came."""
    seen_label: str = "seen as free at the end"
    echoes_label: str = "places that echoes came from"


def looks(result: RunResult) -> list[Look]:
    """Returns the look of each robot; each of several robots has its own colors."""
    if not result.several:
        look = Look(result, COLOURS["robot"], COLOURS["estimate"])
        deaf = result.scenario.only.has_goal
        return [look._replace(body_label="robot") if deaf else look]
    colours = cycle(ROBOT_COLOURS)
    return [
        Look(
            own,
            colour,
            colour,
            f"{name}, path of P"
            if own.scenario.only.kind == "router"
            else f"path of P of {name}",
            "" if own.scenario.only.has_goal else f"{name} with its microphones",
            f"estimates of {name}; faint ones are early",
            colour,
            colour,
            f"seen as free by {name} at the end",
            f"places that echoes to {name} came from",
        )
        for (name, own), colour in zip(result.several.items(), colours, strict=False)
    ]


def lightened(colour: str, part: float) -> str:
    """Mixes a color with white.

    Args:
        colour: Color in any format of matplotlib.
        part: Fraction of the color in the mixture, 0 to 1.

    Returns:
        Lighter color, as a hexadecimal string.
    """
    red, green, blue = (1.0 - part * (1.0 - level) for level in to_rgb(colour))
    return to_hex((red, green, blue))


def run_title(result: RunResult) -> str:
    """Returns the name, the law and the ending of a run on one line."""
    told = result.several and result.cause not in SUCCESSFUL
    who = f"{result.name} " if told else ""
    scenario = result.full_scenario
    return f"{scenario.name}, law {scenario.law_names}: {who}{result.ending}"


def picture_title(result: RunResult) -> str:
    """Returns the title of a picture: ``run_title``, the fault and the duration."""
    fault = f" ({result.collision.fault}'s fault)" if result.collision else ""
    title = f"{run_title(result)}{fault} after {result.simulated_s:.1f} s"
    return textwrap.fill(title, LONGEST_LINE)


def sound_bursts(sound: SoundParameters, end: float) -> list[tuple[float, float]]:
    """Returns all bursts of a sound that begin before a given time.

    Args:
        sound: Parameters of the sound, which contain the schedule of the bursts.
        end: Time, s. A burst that lasts longer ends at this time.

    Returns:
        Start and end of each burst, s.
    """
    starts = np.arange(sound.start_s, end, sound.period_s)
    return [(float(t), min(float(t) + sound.on_s, end)) for t in starts]


def call_time(result: RunResult) -> float | None:
    """Returns the time at which the sink first received a call.

    The sink is the computer of the operator. After a robot has found the odor source,
    it calls the other robots. The function uses the radio frame with which a robot
    reports this find to the sink.

    Args:
        result: Result of a run, for one robot or all robots.

    Returns:
        Time, s. The value is None if the sink received no such frame.
    """
    times = [
        float(result.time[np.argmax(values > 0.5)])
        for name, values in result.world.items()
        if name.endswith(".result") and (values > 0.5).any()
    ]
    return min(times, default=None)


def heard_bursts(result: RunResult) -> list[tuple[float, float]]:
    """Returns the bursts of the source that the robot hears.

    If the robot listens to another robot that calls, the bursts begin after the call.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Start and end of each burst, s. The list is empty if the robot drives to a goal.
    """
    if result.scenario.only.has_goal:
        return []
    sound, whole = result.scenario.source.sound, result.full_scenario
    caller = whole.robots.get(whole.target(result.name))
    if caller is not None and caller.searches == "odor":
        since = call_time(result)
        if since is None:
            return []
        sound = sound.model_copy(update={"start_s": since + sound.start_s})
    return sound_bursts(sound, result.simulated_s)


def logged_sensors(result: RunResult) -> range:
    """Returns the numbers of the range sensors with readings in the log of a run.

    Args:
        result: Result of a run, for one robot.

    Returns:
        Numbers of the sensors, from 0. The range is empty if the log has no readings.
    """
    robot = result.scenario.only
    if isinstance(robot, HasRangeSensors) and "range_1" in result.columns:
        return range(robot.ultrasonic.count)
    return range(0)


def sensor_pose(scenario: Scenario, sensor: int) -> tuple[float, float, float]:
    """Returns the pose of an ultrasonic sensor in the robot frame B.

    Args:
        scenario: Scenario with the positions and the axes of the sensors.
        sensor: Number of the sensor, from 0.

    Returns:
        x, y, theta of the sensor frame U in B, m and rad.
    """
    own = scenario.sensing.ultrasonic.sensors[sensor]
    x, y = own.position_m
    ahead = scenario.only.robot.control_point_m
    return ahead + x, y, math.radians(own.axis_deg)


def compose(
    pose_WB: NDArray[np.float64], pose_BU: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Converts a pose in the robot frame B to a pose in the world frame W.

    Args:
        pose_WB: (3,) pose (x, y, theta) of B in W, m and rad.
        pose_BU: Pose (x, y, theta) in B, m and rad.

    Returns:
        x, y, theta of the pose in W, m and rad. The angle is not wrapped.
    """
    dx, dy = rotate(pose_WB[2], pose_BU[0], pose_BU[1])
    return pose_WB[0] + dx, pose_WB[1] + dy, pose_WB[2] + pose_BU[2]


def moving_and_static(
    scenario: Scenario,
) -> tuple[list[ObstacleParameters], list[ObstacleParameters]]:
    """Returns two lists: the obstacles that ever move, and the obstacles at rest."""
    moving = [o for o in scenario.obstacles if o.path().moves]
    return moving, [o for o in scenario.obstacles if not o.path().moves]


def followed_sources(scenario: Scenario) -> set[str]:
    """Returns the names of the sources that a robot follows."""
    return {scenario.target(name) for name in scenario.robots}.intersection(
        scenario.sources
    )


def bounds(result: RunResult, margin: float) -> tuple[float, float, float, float]:
    """Returns a rectangle that contains all bodies during the whole run.

    The rectangle includes the walls of the room, if there is a room. It ignores
    estimated positions, because a large error would enlarge the picture too much.

    Args:
        result: Result of the run.
        margin: Space around the centers of the bodies, m.

    Returns:
        Least x, greatest x, least y, greatest y in the world frame W, m.
    """
    scenario, times = result.full_scenario, picture_times(result, most=60)
    centres = [
        own.poses(body)[:, :2]
        for own in result.robots.values()
        for body in ("WB", "WS")
    ]
    paths: list[Path] = [each.path() for each in scenario.sources.values()]
    paths += [obstacle.path() for obstacle in scenario.obstacles]
    centres += [path.poses(times)[:, :2] for path in paths]
    points = np.concatenate(centres)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    if scenario.room is not None:
        corner, wall = scenario.room.corner, 0.2
        low = np.minimum(low, corner - wall)
        high = np.maximum(high, corner + scenario.room.size_m[:2] + wall)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def contact_point(result: RunResult) -> NDArray[np.float64]:
    """Returns the point at which the robot touched the other body.

    Args:
        result: Result of a run that ended in a collision.

    Returns:
        (2,) position in the world frame W, m.

    Raises:
        InputError: The run had no collision.
    """
    result = result.robots[result.name]
    hit, scenario = result.collision, result.scenario
    if hit is None:
        raise InputError("contact_point", f"the run ended by {result.cause!r}")
    body = result.surroundings.bodies[hit.object].rectangle(hit.time)
    pose = result.poses("WB")[tick_at(result, hit.time)]
    footprint = robot_rectangle(pose, scenario.only.robot)
    return touching_point(footprint, body)


def touching_point(
    a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the point at which two rectangles touch.

    The point is the mean of all corners of either rectangle that lie inside the other
    rectangle. If there is no such corner, the point is the mean of the corners that are
    nearest to the other rectangle.

    Args:
        a: (5,) first rectangle (x, y, theta, length, width), m and rad.
        b: (5,) second rectangle in the same frame, m and rad.

    Returns:
        (2,) position in the same frame, m.
    """
    corners = np.concatenate([rectangle_corners(a), rectangle_corners(b)])
    others = [b] * 4 + [a] * 4
    away = [
        math.hypot(*nearest_point_on_rectangle(corner, other))
        for corner, other in zip(corners, others, strict=True)
    ]
    return np.mean(corners[np.array(away) <= min(away) + 1e-9], axis=0)
