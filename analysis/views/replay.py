"""Writes a run as an HTML page that plays the run in a browser, without other files."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat, MeshcatParams

from analysis.reporting.palette import COLOURS
from analysis.runs.guarded_motion import guarded_motion
from analysis.runs.known_space import has_known_space, known_space
from analysis.runs.tracked_bodies import tracked_bodies
from analysis.views import replay_scene
from analysis.views.arrows import record_arrows, scale_m_n
from analysis.views.curves import page_charts
from analysis.views.floor_layers import clipped, floor_layers
from analysis.views.replay_layers import replay_layers
from analysis.views.replay_page import ReplayFacts, replay_page
from analysis.views.replay_scene import OBSTACLE_HEIGHT_M, upright
from analysis.views.scene import (
    Look,
    call_time,
    contact_point,
    followed_sources,
    lightened,
    logged_sensors,
    looks,
    moving_and_static,
    run_title,
    sound_bursts,
)
from analysis.views.search_replay import record_searches, record_switch
from diagrams import RunResult, Scenario
from diagrams.scenario.bodies import RecordedPath
from systems.safety.braking import BRAKED, HALTED, PASSED, SLOWED, TURNED
from systems.sound.parameters import SoundParameters

#: Largest number of frames per second that Meshcat records.
FRAMES_PER_S = 32.0
#: Duration of one piece of a trail, s.
TRAIL_PIECE_S = 0.5
#: Time for which each ring of a source is visible, s.
RING_S = 0.0625
#: Gains that the replay shows as bars on a robot. Each entry has the name of the gain,
#: the distance of the bar to the left of the center line, m, and the key of its color.
GAIN_BARS = (
    ("stiffness", 0.05, "source"),
    ("damping", 0.0, "robot"),
    ("contact_stiffness", -0.05, "obstacle"),
)
#: Sizes of the bars. ``BAR_M``: initial height, m. ``MOST_HIGH``: largest ratio of the
#: height to the initial height.
BAR_M, MOST_HIGH = 0.15, 10.0
#: Interval between two displays of the floor that a robot knows, s.
KNOWN_PERIOD_S = 0.5
#: Number of ticks (control periods) in which a map enters its first readings.
FIRST_TICKS = 3
#: Least probability of a tracked body that the replay shows.
LEAST_EXISTS = 0.3
#: Radii of the rings around tracked bodies, m.
TRACKED_M = (0.1, 0.2, 0.4, 0.8)
#: Largest number of cells of all displayed maps together.
MOST_CELLS = 30_000_000


def write_replay(
    result: RunResult,
    path: str | Path,
    clearance: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Writes a self-contained page that plays the run in three dimensions.

    The scene shows:

    - each robot with its wheels, its microphone bar, and the cones of its range sensors
    - the obstacles, the walls of the room, and trails of past positions
    - each source, with a ring that grows while the source sounds
    - a ball at the source position that each robot estimates
    - arrows for the forces of the control law and for the commanded motion
    - a touched object in red, with a star at the point of contact

    A cone is brown while its sensor has an echo.

    For a robot with a safety guard, the scene also shows the floor that the robot knows
    to be free. Dots show where echoes came from. A circle shows the area that the guard
    keeps free. The center of the circle is the position at which the robot would come
    to rest if it braked now. The color of the circle shows the action of the guard:

    - gray: the guard passes the command of the law
    - orange: the guard reduces the command
    - red: the guard brakes

    For the guarded law, the scene also shows a ring around each body that the robot
    takes as moving. The radius of the ring is the uncertainty of the position. For a
    search, the scene also shows the odor plume, and a lamp above each robot
    (``analysis.views.search_replay``).

    Around the scene, the page has:

    - a clock with a slider
    - a legend, with switches for its layers
    - the warnings about the scenario
    - curves over time, with a cursor that follows the clock

    If the address ends with ``#t=2.5``, the replay begins at 2.5 s. The page needs a
    browser with WebGL, but no network.

    Args:
        result: Result of the run.
        path: The .html file.
        clearance: (n,) distance from each robot to the nearest body at the ticks
            (control periods), m, by name of the robot. The page shows these distances
            as curves. A robot without an entry has no such curve.

    Raises:
        OSError: The file cannot be written.
    """
    with _quiet_drake():
        meshcat = Meshcat(MeshcatParams(host="localhost"))
        _build_scene(meshcat, result)
        meshcat.StartRecording(FRAMES_PER_S, set_visualizations_while_recording=False)
        record_run(meshcat, result)
        meshcat.StopRecording()
        meshcat.PublishRecording()
        page = meshcat.StaticHtml()
        del meshcat
    Path(path).write_text(replay_page(page, _facts(result, clearance or {})), "utf-8")


def _facts(result: RunResult, clearance: Mapping[str, ArrayLike]) -> ReplayFacts:
    scenario = result.full_scenario
    paths = {name: robot_path(own, result) for name, own in result.robots.items()}
    estimates = {name: estimate_path(path) for name, path in paths.items()}
    sources = [(source_path(scenario, name), name) for name in scenario.sources]
    obstacles = [(f"obstacles/{o.name}", o.name) for o in scenario.obstacles]
    robots = [(path, name) for name, path in paths.items()]
    return ReplayFacts(
        run_title(result),
        result.simulated_s,
        replay_scene.shown_rectangle(result),
        replay_layers(result, paths, estimates),
        page_charts(result, clearance),
        [*robots, *sources, *obstacles],
        robots,
        [str(each) for each in result.warnings],
    )


@contextmanager
def _quiet_drake() -> Iterator[None]:
    """Suppresses Drake's message with the address of a server that no user needs."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def _build_scene(meshcat: Meshcat, result: RunResult) -> None:
    scenario = result.full_scenario
    replay_scene.add_floor(meshcat, result)
    replay_scene.add_room(meshcat, scenario)
    replay_scene.add_obstacles(meshcat, scenario)
    followed = followed_sources(scenario)
    for name, source in scenario.sources.items():
        role = "source" if name in followed else "interferer"
        replay_scene.add_source(meshcat, source, source_path(scenario, name), role)
    for look in looks(result):
        path = robot_path(look.result, result)
        replay_scene.add_robot(meshcat, look, path, estimate_path(path))
    replay_scene.set_stage(meshcat)


def source_path(scenario: Scenario, name: str) -> str:
    """Returns the path of a source in the scene tree of Meshcat (Drake's 3D viewer).

    Args:
        scenario: Scenario that contains the source. If the scenario has only one
            source, the path is ``source``.
        name: Name of the source.

    Returns:
        Path without a leading slash.
    """
    return f"sources/{name}" if len(scenario.sources) > 1 else "source"


def robot_path(own: RunResult, result: RunResult) -> str:
    """Returns the path of a robot in the scene tree of Meshcat (Drake's 3D viewer).

    Args:
        own: Result of the run, for this robot.
        result: Result of the run, for all robots. If there is only one robot, the path
            is ``robot``.

    Returns:
        Path without a leading slash.
    """
    return f"robots/{own.name}" if result.several else "robot"


def estimate_path(robot: str) -> str:
    """Returns the path of the ball at the source position that a robot estimates."""
    return robot.replace("robot", "estimate", 1)


def record_run(meshcat: Meshcat, result: RunResult) -> None:
    """Records all motion of a run. The objects of the scene must already exist.

    Args:
        meshcat: Meshcat instance (Drake's 3D viewer) that is already recording.
        result: Result of the run.
    """
    frames = np.arange(0.0, result.simulated_s + 0.5 / FRAMES_PER_S, 1.0 / FRAMES_PER_S)
    scenario = result.full_scenario
    sounds, m_per_n = scenario.sounds(), scale_m_n(result)
    for look in looks(result):
        own, path = look.result, robot_path(look.result, result)
        _record_robot(meshcat, own, path, frames)
        _record_estimate(meshcat, own, estimate_path(path))
        p_WP = own.vector("p_WP").T
        _record_trail(meshcat, own, f"trail/{path}", p_WP, look.colour)
        if own.scenario.only.kind == "router":
            _record_target(meshcat, own, path, frames, look.estimates)
            _record_gains(meshcat, own, path, frames)
        if own.name in sounds:
            _record_rings(meshcat, result, path, _called_on(own, sounds[own.name]))
        _record_known_space(meshcat, result, look, path)
        _record_guard(meshcat, own, f"guard/{path}", frames)
        _record_tracked_bodies(meshcat, own, f"tracked/{path}", frames)
        record_arrows(meshcat, own, path, m_per_n)
        _record_follow_distance(meshcat, own, path, frames)
        _record_collision(meshcat, own, path)
    paths = {name: robot_path(own, result) for name, own in result.robots.items()}
    record_searches(meshcat, result, paths)
    followed = followed_sources(scenario)
    for name, source in scenario.sources.items():
        role = "source" if name in followed else "interferer"
        path = source_path(scenario, name)
        poses = source.path().poses(result.time)
        seen = frames if np.ptp(poses, axis=0).any() else frames[:1]
        _record_path(meshcat, path, seen, _at_frames(result, poses, seen))
        _record_rings(meshcat, result, path, sounds[name])
        _record_trail(meshcat, result, f"trail/{path}", poses[:, :2], COLOURS[role])
    for obstacle in moving_and_static(scenario)[0]:
        path, height = f"obstacles/{obstacle.name}", 0.5 * OBSTACLE_HEIGHT_M
        _record_path(meshcat, path, frames, obstacle.path().poses(frames), height)


def _record_follow_distance(
    meshcat: Meshcat, own: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """Records a circle around the target, at the follow distance of P."""
    if (
        own.scenario.only.searches is not None
        or not own.scenario.only.follow_distance_m
    ):
        return
    ring, radius = f"follow/{path}", own.scenario.only.follow_distance_m
    replay_scene.add_disc_edge(meshcat, ring, radius, "law")
    seen = frames if own.target_moves else frames[:1]
    _record_path(meshcat, ring, seen, _at_frames(own, own.poses("WS"), seen))


def _record_collision(meshcat: Meshcat, own: RunResult, path: str) -> None:
    """Shows a star and the touched object in red from the time of the collision on."""
    if own.collision is None:
        return
    star, times = f"collision/{path}", (0.0, own.collision.time)
    replay_scene.add_star(meshcat, star, contact_point(own))
    record_switch(meshcat, star, times, (False, True))
    hit = replay_scene.add_hit(meshcat, own.full_scenario, own.collision.object)
    if hit is not None:
        record_switch(meshcat, hit, times, (False, True))


def _at_frames(
    result: RunResult, values: NDArray[np.float64], frames: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3) poses at the ticks, interpolated to the times of the replay's frames."""
    unwrapped = np.column_stack([values[:, :2], np.unwrap(values[:, 2])])
    return RecordedPath(result.time, unwrapped).poses(frames)


def _record_path(
    meshcat: Meshcat,
    path: str,
    frames: NDArray[np.float64],
    poses: NDArray[np.float64],
    height: float = 0.0,
) -> None:
    for time, (x, y, theta) in zip(frames, poses, strict=True):
        meshcat.SetTransform(path, upright(x, y, height, theta), float(time))


def _record_robot(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    poses = _at_frames(result, result.poses("WB"), frames)
    _record_path(meshcat, path, frames, poses)
    for side, angles in wheel_angles(result).items():
        turned = np.interp(frames, result.time, angles)
        for time, angle in zip(frames, turned, strict=True):
            spin = upright(0.0, 0.0, 0.0, angle)
            meshcat.SetTransform(f"{path}/{side}/wheel", spin, float(time))
    for sensor in logged_sensors(result):
        echo = result.columns[f"echo_{sensor + 1}"] > 0.5
        cone = f"{path}/cone_{sensor + 1}"
        record_switch(meshcat, f"{cone}/echo", result.time, echo)
        record_switch(meshcat, f"{cone}/empty", result.time, ~echo)


def wheel_angles(result: RunResult) -> dict[str, NDArray[np.float64]]:
    """(n,) angles of both wheels for rolling without slip on the robot's path, rad."""
    robot, path = result.scenario.only.robot, result.poses("WB")
    theta = np.unwrap(path[:, 2])
    between = 0.5 * (theta[1:] + theta[:-1])
    steps = np.diff(path[:, :2], axis=0)
    forward = steps[:, 0] * np.cos(between) + steps[:, 1] * np.sin(between)
    turn = 0.5 * robot.wheel_separation_m * np.diff(theta)
    return {
        "left": np.r_[0.0, np.cumsum(forward - turn)] / robot.wheel_radius_m,
        "right": np.r_[0.0, np.cumsum(forward + turn)] / robot.wheel_radius_m,
    }


def _called_on(own: RunResult, sound: SoundParameters) -> SoundParameters:
    """Returns the sound of a robot's loudspeaker, delayed until the robot calls."""
    if own.scenario.only.searches != "odor":
        return sound
    since = call_time(own)
    start = own.simulated_s if since is None else since + sound.start_s
    return sound.model_copy(update={"start_s": start})


def _record_rings(
    meshcat: Meshcat, result: RunResult, path: str, sound: SoundParameters
) -> None:
    bursts = sound_bursts(sound, result.simulated_s)
    times = np.arange(0.0, result.simulated_s, RING_S / 2.0)
    for number in range(len(replay_scene.RINGS)):
        seen = [ring_at(time, bursts) == number for time in times]
        record_switch(meshcat, f"{path}/ring_{number + 1}", times, seen)


def ring_at(time: float, bursts: list[tuple[float, float]]) -> int | None:
    """Returns which ring of a source is visible at a given time.

    While the source sounds, its rings appear one after the other.

    Args:
        time: Time, s.
        bursts: Start and end of each burst, s. The bursts do not overlap.

    Returns:
        Index into ``RINGS``. The value is None if the source is silent at this time.
    """
    for start, end in bursts:
        if start <= time < end:
            return math.floor((time - start) / RING_S) % len(replay_scene.RINGS)
    return None


def _record_estimate(meshcat: Meshcat, result: RunResult, path: str) -> None:
    """Records the ball at the estimated source position.

    The ball jumps when the robot hears an audio frame, and rests otherwise.
    """
    if "p_WS_estimated_x" not in result.columns:
        return
    valid = result.columns["target_valid"] > 0.5
    record_switch(meshcat, path, result.time, valid)
    height = replay_scene.SOURCE_HEIGHT_M + 0.12
    places = result.vector("p_WS_estimated").T
    for tick in np.flatnonzero(valid):
        if tick and valid[tick - 1] and np.allclose(places[tick], places[tick - 1]):
            continue
        x, y = places[tick]
        if tick and valid[tick - 1]:
            # This keyframe keeps the ball at rest until the new estimate.
            x_0, y_0 = places[tick - 1]
            before = float(result.time[tick - 1])
            meshcat.SetTransform(path, upright(x_0, y_0, height, 0.0), before)
        time = float(result.time[tick])
        meshcat.SetTransform(path, upright(x, y, height, 0.0), time)


def _record_target(
    meshcat: Meshcat,
    result: RunResult,
    path: str,
    frames: NDArray[np.float64],
    colour: str,
) -> None:
    """Records the ball at the target on the route, and the thin trail of the target."""
    places = result.vector("target").T
    flat = np.column_stack([places, np.zeros(len(places))])
    height = replay_scene.SOURCE_HEIGHT_M
    seen = _at_frames(result, flat, frames)
    _record_path(meshcat, estimate_path(path), frames, seen, height)
    trail = f"trail/target/{path}"
    _record_trail(meshcat, result, trail, places, colour, thin=True)


def _record_gains(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """Records one bar per adapted gain; the height is relative to the initial gain."""
    for name, aside, colour in GAIN_BARS:
        if name not in result.columns or result.columns[name][0] <= 0.0:
            continue
        bar = f"{path}/{name}"
        replay_scene.add_gain_bar(meshcat, bar, aside, colour)
        share = result.columns[name] / result.columns[name][0]
        heights = np.interp(frames, result.time, np.clip(share, 0.0, MOST_HIGH))
        for time, height in zip(frames, BAR_M * heights, strict=True):
            meshcat.SetProperty(bar, "scale", [1.0, 1.0, height], float(time))


def _record_known_space(
    meshcat: Meshcat, result: RunResult, look: Look, path: str
) -> None:
    """Shows the floor that a robot knows to be free, and dots at echo positions."""
    own = look.result
    if not has_known_space(own):
        return
    known = known_space(own, known_times(own))
    if known is None:
        return
    floor = replay_scene.floor_rectangle(result)
    # The floors of several robots have different heights. Surfaces in one plane would
    # flicker.
    above = 0.0005 * [*result.robots].index(own.name)
    dots = 0.25 * known.cell_m * np.array([1.0, -1.0, 1.0, -1.0])
    for name, cells, colour, height, inset in (
        ("free", known.free, lightened(look.seen, 0.2), 0.001, 0.0 * dots),
        ("echoes", known.hits > 0.0, look.echoes, 0.006, dots),
    ):
        layers = floor_layers(known, cells, whole=name == "free")
        for number, layer in enumerate(layers):
            rectangles = clipped(layer.rectangles + inset, floor)
            if not len(rectangles):
                continue
            part = f"known/{path}/{name}_{number}"
            replay_scene.add_floor_part(
                meshcat, part, rectangles, colour, height + above
            )
            states = [layer.begin <= k < layer.end for k in range(len(known.times))]
            record_switch(meshcat, part, known.times, states)


def known_times(result: RunResult) -> list[float]:
    """Returns the times at which the replay updates the floor that a robot knows, s.

    The interval is 0.5 s. If the map has many cells, the interval is longer. Then all
    displayed maps together have at most about ``MOST_CELLS`` cells.
    """
    end, scenario = result.simulated_s, result.scenario
    most = max(2, MOST_CELLS // scenario.follower.own_map.cells**2)
    period = max(KNOWN_PERIOD_S, end / most)
    first = min(FIRST_TICKS * scenario.tick_s, end)
    return [first, *np.arange(period, end, period).tolist(), end]


def _record_guard(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """Records the edge of the disc that the safety guard keeps free.

    If the robot braked now, its axle would stop at the center of the disc.
    """
    motion = guarded_motion(result)
    if motion is None:
        return
    rests = _at_frames(result, motion.resting_poses, frames)
    _record_path(meshcat, path, frames, rests)
    for name, colour, numbers in _EDGES:
        edge = f"{path}/{name}"
        replay_scene.add_disc_edge(meshcat, edge, motion.keep_m, colour)
        seen = np.isin(motion.actions, numbers)
        record_switch(meshcat, edge, result.time, seen)


#: Edges of the guarded disc: name, key of the color, and actions of the guard for which
#: the edge is visible.
_EDGES = (
    ("passed", "passed", (PASSED,)),
    ("lessened", "lessened", (SLOWED, TURNED)),
    ("braked", "hit", (BRAKED, HALTED)),
)


def _record_tracked_bodies(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """Records a ring around each body that the control law takes as moving.

    The radius of the ring shows the uncertainty of the position.
    """
    tracked = tracked_bodies(result, frames)
    if tracked is None:
        return
    for k in range(tracked.exists.shape[1]):
        seen = tracked.exists[:, k] > LEAST_EXISTS
        if not seen.any():
            continue
        for time, there, (x, y) in zip(
            tracked.times, seen, tracked.places[:, k], strict=True
        ):
            if there:
                place = upright(float(x), float(y), 0.0)
                meshcat.SetTransform(f"{path}/{k}", place, float(time))
        wide = np.minimum(tracked.spreads[:, k], TRACKED_M[-1])
        for least, radius in pairwise((0.0, *TRACKED_M)):
            ring = f"{path}/{k}/{radius:g}"
            states = seen & (wide > least) & (wide <= radius)
            if states.any():
                replay_scene.add_disc_edge(meshcat, ring, radius, "tracked")
                record_switch(meshcat, ring, tracked.times, states)


def _record_trail(
    meshcat: Meshcat,
    result: RunResult,
    path: str,
    points: NDArray[np.float64],
    colour: str,
    *,
    thin: bool = False,
) -> None:
    """Adds the pieces of a trail, and records when each piece becomes visible.

    A piece becomes visible when the body has driven along the piece.
    """
    step = max(1, round(TRAIL_PIECE_S / result.scenario.tick_s))
    for number, start in enumerate(range(0, len(points) - 1, step)):
        piece = points[start : start + step + 1]
        if not np.ptp(piece, axis=0).any():
            continue
        name = f"{path}/{number}"
        replay_scene.add_trail(meshcat, name, piece, colour, thin=thin)
        drawn = result.time[min(start + step, len(points) - 1)]
        record_switch(meshcat, name, (0.0, drawn), (False, True))
