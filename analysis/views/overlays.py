"""Makes the things that only the replay of a run shows.

They are forces, commands of the laws, outlines that the safety guards keep free, tracks
of moving bodies, lamps and gains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.report.palette import COLORS
from analysis.runs.guarded_motion import guarded_motion
from analysis.runs.tracked_bodies import tracked_bodies
from analysis.views.scene import ROBOT_HEIGHT_M, Layer, Scene, Thing
from diagrams import RunResult
from systems.safety.braking import BRAKED, HALTED, PASSED, SLOWED, TURNED
from systems.world.geometry import rotate

#: Rate at which arrows are recorded, 1/s. The browser interpolates in between.
ARROWS_PER_S = 8.0
#: Lengths of arrows, m. ``LONGEST_M``: largest length of the arrow for the greatest
#: force (see ``scale_m_n``). ``SHORTEST_M``: length of the shortest arrow.
LONGEST_M, SHORTEST_M = 0.8, 1e-3
#: Height of the arrows, m. They are above the microphones.
ARROW_HEIGHT_M = 0.36
#: Least probability of a tracked body that the replay shows.
LEAST_EXISTS = 0.3
#: Radii of the rings around tracked bodies, m.
TRACKED_M = (0.1, 0.2, 0.4, 0.8)
#: The outline that a guard keeps free has one color for each group of actions
#: of the guard: name, key of the color, and actions.
_EDGES = (
    ("passed", "passed", (PASSED,)),
    ("lessened", "lessened", (SLOWED, TURNED)),
    ("braked", "hit", (BRAKED, HALTED)),
)
#: Height of the lamp above a robot, m.
_LAMP_M = 0.32
#: Color of the lamp for each state of the robot.
_LAMPS = {
    "rests": COLORS["empty"],
    "senses": COLORS["sound"],
    "moves": COLORS["robot"],
    "found": COLORS["seen"],
    "gave up": COLORS["source"],
}
#: Duration of the flash for a radio frame, s.
_FLASH_S = 0.25
#: Gains that the replay shows as bars on a robot. Each entry has the name of the gain,
#: the distance of the bar to the left of the center line, m, and the key of its color.
_GAIN_BARS = (
    ("stiffness", 0.05, "source"),
    ("damping", 0.0, "robot"),
    ("contact_stiffness", -0.05, "obstacle"),
)
#: Sizes of the bars. ``_BAR_M``: initial height, m. ``_MOST_HIGH``: largest ratio of
#: the height to the initial height.
_BAR_M, _MOST_HIGH = 0.15, 10.0


class Frame(NamedTuple):
    """An invisible thing that carries other things."""


class Arrow(NamedTuple):
    """A flat arrow along x that is 1 m long."""


class Circle(NamedTuple):
    """A circle on the floor."""

    radius: float


class Outline(NamedTuple):
    """The edge of a rectangle on the floor."""

    half_length: float
    half_width: float


class Bar(NamedTuple):
    """An upright bar that is 1 m high."""


class Ball(NamedTuple):
    """A ball."""

    radius: float


class Disc(NamedTuple):
    """A thin disc on the floor."""

    radius: float


def overlays(scene: Scene, times: NDArray[np.float64]) -> list[Layer]:
    """Makes the layers that only a replay shows.

    ``times`` are the (n,) times of the frames of the replay, s.
    """
    return [
        *_laws(scene),
        *_guards(scene),
        *_tracked(scene, times),
        *_lamps(scene),
        *_gains(scene),
    ]


def scale_m_n(result: RunResult) -> float | None:
    """Returns the length, m, of an arrow for a force of 1 N.

    The result is the largest value of the form 1, 2 or 5 times 10^k with which the
    arrow of the greatest force is at most 0.8 m long. The greatest force is the 99th
    percentile of all forces in the run. The result is None if no law logs its forces.
    """
    sizes = [
        np.hypot(*own.vector(name))
        for own in result.robots.values()
        if "attraction_x" in own.columns
        for name in ("attraction", "repulsion")
    ]
    if not sizes:
        return None
    # A short contact must not make all other arrows short.
    greatest = max(float(np.percentile(np.concatenate(sizes), 99.0)), 1e-3)
    power = 10.0 ** np.floor(np.log10(LONGEST_M / greatest))
    return float(max(k * power for k in (1, 2, 5) if k * power * greatest <= LONGEST_M))


def commanded_velocity(own: RunResult) -> NDArray[np.float64]:
    """Returns the velocity of P that the wheel commands of one robot would cause.

    P is the control point. The result has the shape (n, 2): x and y in W at each tick
    (control period), m/s.
    """
    robot, theta = own.scenario.only.robot, own.columns["theta_WB"]
    left = robot.wheel_radius_m * own.columns["wheel_speed_left"]
    right = robot.wheel_radius_m * own.columns["wheel_speed_right"]
    aside = robot.control_point_m * (right - left) / robot.wheel_separation_m
    return np.column_stack(rotate(theta, 0.5 * (left + right), aside))


def _laws(scene: Scene) -> Iterator[Layer]:
    """Yields a layer with the forces on P, and a layer with the command of the law.

    An arrow shows how far P would move in 1 s at the command. A circle around the
    source shows the follow distance.
    """
    result, forces, laws = scene.result, [], []
    m_per_n, meaning = scale_m_n(result), "path of 1 s at the command"
    for name, own in result.robots.items():
        path, robot = scene.bodies[name].path, own.scenario.only
        number = 0
        if m_per_n is not None and "attraction_x" in own.columns:
            for force in ("attraction", "repulsion"):
                vectors = m_per_n * own.vector(force).T
                place = f"forces/{path}/{force}"
                forces.append(_arrow(place, own, vectors, force, number))
                number += 1
        law = _arrow(f"law/{path}", own, commanded_velocity(own), "law", number)
        laws.append(law)
        if robot.searches is None and robot.follow_distance_m:
            shape, color = Circle(robot.follow_distance_m), COLORS["law"]
            poses, place = own.poses("WS"), f"follow/{path}"
            laws.append(Thing(place, shape, color, own.time, poses))
            meaning = "path of 1 s at the command; follow distance"
    if forces:
        text = f"attraction and repulsion; an arrow of {m_per_n:g} m is 1 N"
        colors = COLORS["attraction"], COLORS["repulsion"]
        yield Layer("forces", text, colors, forces)
    yield Layer("law", meaning, (COLORS["law"],), laws)


def _arrow(
    path: str, own: RunResult, vectors: NDArray[np.float64], role: str, number: int
) -> Thing:
    """Makes an arrow that begins at P.

    ``vectors`` are the (n, 2) vectors of the arrow at the ticks, in W, m. ``number``
    counts the arrows of a robot, and sets the height of the arrow.
    """
    end = own.simulated_s
    times = np.unique([*np.arange(0.0, end, 1.0 / ARROWS_PER_S), end])
    ticks = np.abs(own.time[:, None] - times).argmin(axis=0)
    vectors = vectors[ticks]
    lengths = np.clip(np.hypot(*vectors.T), SHORTEST_M, 2.0 * LONGEST_M)
    # An arrow without length keeps its direction.
    last = np.maximum.accumulate(
        np.where(lengths > SHORTEST_M, np.arange(len(times)), -1)
    )
    yaw = np.where(last >= 0, np.arctan2(vectors[last, 1], vectors[last, 0]), 0.0)
    poses = np.column_stack([own.vector("p_WP").T[ticks], yaw])
    wide = np.minimum(1.0, lengths / 0.3)
    arrow = Thing(path, Arrow(), COLORS[role], times, poses)
    # The arrows have different heights. Surfaces in one plane would flicker.
    return replace(
        arrow,
        height=ARROW_HEIGHT_M + 0.004 * number,
        scale=np.column_stack([lengths, wide, np.ones(len(times))]),
    )


def _guards(scene: Scene) -> Iterator[Layer]:
    """Yields a layer with one rectangle per guard.

    The rectangle is the outline of the body plus the margin, at the pose at which the
    robot would come to rest if it braked now. The guard keeps it in free space. Its
    color shows the action of the guard.
    """
    things = []
    for name, own in scene.result.robots.items():
        motion = guarded_motion(own)
        if motion is None:
            continue
        path, still = f"guard/{scene.bodies[name].path}", np.zeros((1, 3))
        rests = Thing(path, Frame(), "", own.time, motion.resting_poses)
        things.append(rests)
        outline = Outline(*motion.half_size_m)
        edge_at_rest = Thing("", outline, "", own.time, still, parent=rests)
        things += [
            replace(
                edge_at_rest,
                path=f"{path}/{edge}",
                color=COLORS[color],
                seen=np.isin(motion.actions, numbers),
            )
            for edge, color, numbers in _EDGES
        ]
    colors = COLORS["passed"], COLORS["lessened"], COLORS["hit"]
    if things:
        yield Layer("guard", "passed the command, slowed, braked", colors, things)


def _tracked(scene: Scene, times: ArrayLike) -> Iterator[Layer]:
    """Yields a layer with a ring for each body that a robot tracks as moving.

    The radius of the ring shows the uncertainty of the position. It is one of
    ``TRACKED_M``.
    """
    things, color, plans = [], COLORS["tracked"], False
    for name, own in scene.result.robots.items():
        tracked = tracked_bodies(own, times)
        if tracked is None:
            continue
        plans = True
        for k in range(tracked.exists.shape[1]):
            seen = tracked.exists[:, k] > LEAST_EXISTS
            if not seen.any():
                continue
            path = f"tracked/{scene.bodies[name].path}/{k}"
            places = np.where(seen[:, None], tracked.places[:, k], np.nan)
            poses = np.column_stack([places, np.zeros(len(seen))])
            body = Thing(path, Frame(), color, tracked.times, poses)
            things.append(body)
            wide = np.minimum(tracked.spreads[:, k], TRACKED_M[-1])
            for least, radius in pairwise((0.0, *TRACKED_M)):
                states = seen & (wide > least) & (wide <= radius)
                if states.any():
                    things.append(
                        Thing(
                            f"{path}/{radius:g}",
                            Circle(radius),
                            color,
                            tracked.times,
                            np.zeros((1, 3)),
                            seen=states,
                            parent=body,
                        )
                    )
    if plans:
        meaning = "bodies that the robot takes as moving"
        yield Layer("tracked", meaning, (color,), things)


def _lamps(scene: Scene) -> Iterator[Layer]:
    """Yields a layer with a lamp above each robot that searches.

    The color of the lamp shows what the robot does. Above the lamp, a white ball
    flashes when a radio frame of the robot arrives at the sink.
    """
    things = []
    for name, own in scene.result.robots.items():
        if own.scenario.only.searches is None:
            continue
        columns, robot = own.columns, scene.bodies[name]
        over, moves = columns["search_ended"], columns["move"] > 0.5
        going = over < 0.5
        senses = columns.get("listening", np.zeros_like(over)) > 0.5
        states = {
            "rests": going & ~moves & ~senses,
            "senses": going & senses,
            "moves": going & moves,
            "found": np.abs(over - 1.0) < 0.5,
            "gave up": over > 1.5,
        }
        ball = Thing("", Ball(0.035), "", own.time, np.zeros((1, 3)), parent=robot)
        ball = replace(ball, height=_LAMP_M)
        things += [
            replace(
                ball, path=f"{robot.path}/lamp/{state}", color=_LAMPS[state], seen=seen
            )
            for state, seen in states.items()
        ]
        frames = scene.result.world.get(f"{name}.frames")
        if frames is None:
            continue
        heard = own.time[1:][np.diff(frames) > 0.5]
        since = np.searchsorted(heard, own.time, side="right")
        last = np.where(since > 0, np.r_[-1e9, heard][since], -1e9)
        flash = replace(ball, path=f"{robot.path}/radio", shape=Ball(0.06), alpha=0.8)
        lit = own.time - last < _FLASH_S
        height = _LAMP_M + 0.09
        things.append(replace(flash, color="white", height=height, seen=lit))
    text = "gray: at rest; yellow: senses; blue: moves; green: found; orange: gave up"
    if things:
        yield Layer("lamps", text, (COLORS["sound"],), things)


def _gains(scene: Scene) -> Iterator[Layer]:
    """Yields a layer with one bar for each gain of a robot on a route.

    The height of a bar is proportional to the gain divided by its initial value.
    """
    things = []
    for name, own in scene.result.robots.items():
        if own.scenario.only.kind != "router":
            continue
        for gain, aside, color in _GAIN_BARS:
            if gain not in own.columns or own.columns[gain][0] <= 0.0:
                continue
            values, robot = own.columns[gain], scene.bodies[name]
            share = np.clip(values / values[0], 0.0, _MOST_HIGH)
            ones = np.ones(len(share))
            place = np.array([[0.0, aside, 0.0]])
            bar = Thing(f"{robot.path}/{gain}", Bar(), COLORS[color], own.time, place)
            scale = np.column_stack([ones, ones, _BAR_M * share])
            things.append(
                replace(bar, parent=robot, height=ROBOT_HEIGHT_M, scale=scale)
            )
    colors = COLORS["source"], COLORS["robot"], COLORS["obstacle"]
    text = "K, D and K_e; a bar of 15 cm is the initial value"
    if things:
        yield Layer("gains", text, colors, things)
