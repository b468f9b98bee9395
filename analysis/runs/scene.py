"""Where things are at a time: shared by all pictures."""

from __future__ import annotations

import math
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

#: Spacings of instants that a reader can count in, s.
_NICE_PERIODS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0)


def tick_at(result: RunResult, time: float) -> int:
    """Index of the tick nearest to a time in s.

    Args:
        result: The run.
        time: s; before the start or after the end, the first or last tick is meant.

    Returns:
        Row of ``trajectory``, from 0.
    """
    return int(np.argmin(np.abs(result.time - time)))


def picture_times(result: RunResult, most: int = 10) -> NDArray[np.float64]:
    """Evenly spaced instants from the start, at most so many, s.

    Args:
        result: The run.
        most: At least 2.

    Returns:
        (n,) ascending from 0, s.
    """
    end = result.simulated_s
    period = next((p for p in _NICE_PERIODS_S if end / p < most), end / (most - 1))
    return np.arange(0.0, end + 1e-9, period)


class Look(NamedTuple):
    """How one robot is shown."""

    result: RunResult
    """What it did."""
    colour: str
    """Of its path and its body."""
    estimates: str
    """Colour of where it takes the source to be."""
    path_label: str = "path of the control point P"
    body_label: str = "robot with its microphones"
    """Empty: the path's colour tells."""
    estimates_label: str = "estimates of the source; faint ones are early"
    seen: str = COLOURS["seen"]
    """Of the floor that it knows to be free, much lightened."""
    echoes: str = COLOURS["echoes"]
    """Colour of where its echoes came from."""
    seen_label: str = "seen as free at the end"
    echoes_label: str = "places that echoes came from"


def looks(result: RunResult) -> list[Look]:
    """Each robot of a run, in colours of its own where there are several."""
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
    """A colour laid thinly on white.

    Args:
        colour: As matplotlib takes it.
        part: How much of it is left.

    Returns:
        The light colour.
    """
    red, green, blue = (1.0 - part * (1.0 - level) for level in to_rgb(colour))
    return to_hex((red, green, blue))


def run_title(result: RunResult) -> str:
    """What was run and how it ended, on one line."""
    told = result.several and result.cause not in SUCCESSFUL
    who = f"{result.name} " if told else ""
    scenario = result.full_scenario
    return f"{scenario.name}, law {scenario.law_names}: {who}{result.ending}"


def sound_bursts(sound: SoundParameters, end: float) -> list[tuple[float, float]]:
    """Every burst that begins before an end.

    Args:
        sound: Has the schedule.
        end: s; a burst that is under way is cut off there.

    Returns:
        From and to, s, of each.
    """
    starts = np.arange(sound.start_s, end, sound.period_s)
    return [(float(t), min(float(t) + sound.on_s, end)) for t in starts]


def logged_sensors(result: RunResult) -> range:
    """The range sensors whose readings a run has logged.

    Args:
        result: The run of one robot.

    Returns:
        Their numbers, from 0; none without cones.
    """
    robot = result.scenario.only
    if isinstance(robot, HasRangeSensors) and "range_1" in result.columns:
        return range(robot.ultrasonic.count)
    return range(0)


def sensor_pose(scenario: Scenario, sensor: int) -> tuple[float, float, float]:
    """(x, y, theta) of an ultrasonic sensor in B, m and rad.

    Args:
        scenario: Places and axes of the sensors.
        sensor: Its number, from 0.

    Returns:
        x, y, theta of the sensor's frame U in B, m and rad.
    """
    own = scenario.sensing.ultrasonic.sensors[sensor]
    x, y = own.position_m
    ahead = scenario.only.robot.control_point_m
    return ahead + x, y, math.radians(own.axis_deg)


def compose(
    pose_WB: NDArray[np.float64], pose_BU: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A pose in B as one in W.

    Args:
        pose_WB: (3,) x, y, theta, m and rad.
        pose_BU: x, y, theta, m and rad.

    Returns:
        x, y, theta of pose_WU, m and rad; the angle is not wrapped.
    """
    dx, dy = rotate(pose_WB[2], pose_BU[0], pose_BU[1])
    return pose_WB[0] + dx, pose_WB[1] + dy, pose_WB[2] + pose_BU[2]


def moving_and_static(
    scenario: Scenario,
) -> tuple[list[ObstacleParameters], list[ObstacleParameters]]:
    """The obstacles that move, and those that never do."""
    moving = [o for o in scenario.obstacles if o.path().moves]
    return moving, [o for o in scenario.obstacles if not o.path().moves]


def followed_sources(scenario: Scenario) -> set[str]:
    """Names of the sources that a robot follows; the others interfere."""
    return {scenario.target(name) for name in scenario.robots}.intersection(
        scenario.sources
    )


def bounds(result: RunResult, margin: float) -> tuple[float, float, float, float]:
    """Smallest x, largest x, smallest y, largest y of all bodies ever, m.

    With the walls of the room, where there is one. Estimates do not count: a wild one
    would shrink all else.

    Args:
        result: The run.
        margin: To be left about the bodies' middles, m.

    Returns:
        In W, m.
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
    """Where the robot touched what it hit, (2,) in W, m.

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
    """Where two rectangles touch.

    The mean of the corners of either that lie in the other, or of the nearest
    ones if none does.

    Args:
        a: (5,) x, y, theta, length, width, m and rad.
        b: (5,) of the other one, in the same frame.

    Returns:
        (2,) in that frame, m.
    """
    corners = np.concatenate([rectangle_corners(a), rectangle_corners(b)])
    others = [b] * 4 + [a] * 4
    away = [
        math.hypot(*nearest_point_on_rectangle(corner, other))
        for corner, other in zip(corners, others, strict=True)
    ]
    return np.mean(corners[np.array(away) <= min(away) + 1e-9], axis=0)
