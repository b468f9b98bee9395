"""A run as a page that plays in a browser, with nothing else needed."""

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

from analysis.plumes.search_panels import call_time
from analysis.plumes.search_replay import record_searches, record_switch
from analysis.replays.arrows import record_arrows, scale_m_n
from analysis.replays.replay_page import ReplayFacts, replay_page
from analysis.replays.time_charts import Chart, time_chart
from analysis.reporting.palette import COLOURS
from analysis.runs import replay_scene
from analysis.runs.floor_layers import clipped, floor_layers
from analysis.runs.guarded_motion import guarded_motion
from analysis.runs.known_space import has_known_space, known_space
from analysis.runs.replay_layers import replay_layers
from analysis.runs.replay_scene import OBSTACLE_HEIGHT_M, upright
from analysis.runs.run_plots import clearance_panel, heard_bursts, time_panels
from analysis.runs.scene import (
    Look,
    contact_point,
    followed_sources,
    lightened,
    logged_sensors,
    looks,
    moving_and_static,
    run_title,
    sound_bursts,
)
from analysis.runs.tracked_bodies import tracked_bodies
from diagrams import RunResult, Scenario
from diagrams.scenario.bodies import RecordedPath
from systems.safety.braking import BRAKED, HALTED, PASSED, SLOWED, TURNED
from systems.sound.parameters import SoundParameters

#: Meshcat records at most so many frames a second.
FRAMES_PER_S = 32.0
#: Length of a piece of trail, s.
TRAIL_PIECE_S = 0.5
#: Time for which one ring of the sound is seen, s.
RING_S = 0.0625
#: Gains that a robot shows as bars: how far to the left, m, and in which colour.
GAIN_BARS = (
    ("stiffness", 0.05, "source"),
    ("damping", 0.0, "robot"),
    ("contact_stiffness", -0.05, "obstacle"),
)
#: Height of a bar at the start, m, and how many times that it gets at most.
BAR_M, MOST_HIGH = 0.15, 10.0
#: What a robot knows of the floor is shown anew so often, s.
KNOWN_PERIOD_S = 0.5
#: A map takes so many ticks to enter all that was seen at the first one.
FIRST_TICKS = 3
#: Bodies are shown as tracked that are so likely, with rings of these radii, m.
LEAST_EXISTS = 0.3
TRACKED_M = (0.1, 0.2, 0.4, 0.8)
#: Cells of all these maps at most.
MOST_CELLS = 30_000_000


def write_replay(
    result: RunResult,
    path: str | Path,
    clearance: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Writes a self-contained page that plays the run.

    The robot with its microphone bar, wheels and cones (a cone is brown
    while it has an echo), the obstacles, the sources, each with a ring that grows
    while it sounds, where the robot takes its source to be (a ball), the forces of
    its law and the way that it commands (arrows), the walls of the room, and
    trails; what was hit turns red under a star. Of a guarded robot also the floor that
    it knows to be free, dots where
    echoes came from, and a circle about the place where it could rest by now: the
    edge of what the guard keeps free, grey where it passed what the law commanded,
    orange where it gave less, red where it braked. Of the guarded law also a ring about
    each body that it takes to move, as wide as it is unsure of its place. Of searches
    also the plume, and a lamp over each robot (``analysis.plumes.search_replay``).

    Round the scene: a clock that can be moved, a legend whose layers can be switched
    off, the warnings about the scenario, and curves over time whose cursor follows the
    clock. ``#t=2.5`` behind the address begins there. The page needs a browser with
    WebGL, but no network.

    Args:
        result: The run.
        path: The .html file.
        clearance: (n,) distance of each robot to the nearest body at the ticks, m, by
            its name, for a curve of it; none leaves it out.

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
        time_charts(result, clearance),
        [*robots, *sources, *obstacles],
        robots,
        [str(each) for each in result.warnings],
    )


def time_charts(result: RunResult, clearance: Mapping[str, ArrayLike]) -> list[Chart]:
    """What ``plot_time_series`` shows of each robot, as data.

    Panels without a curve are left out.

    Args:
        result: The run.
        clearance: As of ``write_replay``.

    Returns:
        Charts, robot after robot.
    """
    found = []
    for name, own in result.robots.items():
        panels, bursts = time_panels(own), heard_bursts(own)
        if name in clearance:
            panels.append(clearance_panel(clearance[name]))
        robot = name if result.several else ""
        found += [time_chart(panel, own, robot, bursts) for panel in panels]
    return [chart for chart in found if chart.series]


@contextmanager
def _quiet_drake() -> Iterator[None]:
    """Drake announces the address of a server that nobody is meant to open."""
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
    """Where a source is in Meshcat's tree: the only one is ``source``.

    Args:
        scenario: Says whether there are several sources.
        name: Of the source.

    Returns:
        Path without a slash in front.
    """
    return f"sources/{name}" if len(scenario.sources) > 1 else "source"


def robot_path(own: RunResult, result: RunResult) -> str:
    """Where one robot of a run is in Meshcat's tree: the only one is ``robot``.

    Args:
        own: The run of that robot.
        result: The run of all of them.

    Returns:
        Path without a slash in front.
    """
    return f"robots/{own.name}" if result.several else "robot"


def estimate_path(robot: str) -> str:
    """Where the ball is that shows where a robot takes the source to be."""
    return robot.replace("robot", "estimate", 1)


def record_run(meshcat: Meshcat, result: RunResult) -> None:
    """Records all motion of a run; the bodies must have been made before.

    Args:
        meshcat: Records already.
        result: The run.
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
    """A ring about what is followed, on which P is to be."""
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
    """From the collision on a star over the place, and what was hit in red."""
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
    """(n, 3) poses at the ticks, interpolated to the frames."""
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
    """Angles of wheels that roll without slip on the robot's path, (n,) rad."""
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
    """The sound of a robot's loudspeaker, from its call on if it calls."""
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
    """Which ring is seen at a time, s: each in turn while the source sounds.

    Args:
        time: s.
        bursts: Begin and end of each, s, that do not overlap.

    Returns:
        Index into ``RINGS``, or None in silence.
    """
    for start, end in bursts:
        if start <= time < end:
            return math.floor((time - start) / RING_S) % len(replay_scene.RINGS)
    return None


def _record_estimate(meshcat: Meshcat, result: RunResult, path: str) -> None:
    """The ball jumps when a frame is heard and rests in between."""
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
            # Without this the ball would glide here from the last burst on.
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
    """The ball is the target on the way, and leaves a thin line."""
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
    """Bars on the back of a robot whose gains adapt: as high as they were at first."""
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
    """Parts of the floor, seen while the robot knows them; and dots of echoes."""
    own = look.result
    if not has_known_space(own):
        return
    known = known_space(own, known_times(own))
    if known is None:
        return
    floor = replay_scene.floor_rectangle(result)
    # Of several robots no two are in one plane, which would flicker.
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
    """When the floor that a robot knows is shown anew, s.

    Each half second, or so seldom that fine cells do not fill the memory.
    """
    end, scenario = result.simulated_s, result.scenario
    most = max(2, MOST_CELLS // scenario.follower.own_map.cells**2)
    period = max(KNOWN_PERIOD_S, end / most)
    first = min(FIRST_TICKS * scenario.tick_s, end)
    return [first, *np.arange(period, end, period).tolist(), end]


def _record_guard(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """The edge of the disc that the guard keeps free, about where robots can rest."""
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


#: Edges of the guarded disc, their colours, and what the guard did meanwhile.
_EDGES = (
    ("passed", "passed", (PASSED,)),
    ("lessened", "lessened", (SLOWED, TURNED)),
    ("braked", "hit", (BRAKED, HALTED)),
)


def _record_tracked_bodies(
    meshcat: Meshcat, result: RunResult, path: str, frames: NDArray[np.float64]
) -> None:
    """A ring about each body that the law takes to move, as wide as it is unsure."""
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
    """Pieces that are there from the start and seen once they are driven."""
    step = max(1, round(TRAIL_PIECE_S / result.scenario.tick_s))
    for number, start in enumerate(range(0, len(points) - 1, step)):
        piece = points[start : start + step + 1]
        if not np.ptp(piece, axis=0).any():
            continue
        name = f"{path}/{number}"
        replay_scene.add_trail(meshcat, name, piece, colour, thin=thin)
        drawn = result.time[min(start + step, len(points) - 1)]
        record_switch(meshcat, name, (0.0, drawn), (False, True))
