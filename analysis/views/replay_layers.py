"""Lists the layers of a replay for its legend, and which layers can be hidden."""

from __future__ import annotations

from analysis.reporting.palette import COLOURS
from analysis.runs.known_space import has_known_space
from analysis.views.arrows import arrow_path, arrows, scale_m_n
from analysis.views.replay_page import Layer
from analysis.views.scene import followed_sources, lightened, logged_sensors, looks
from diagrams import RunResult


def replay_layers(
    result: RunResult, paths: dict[str, str], estimates: dict[str, str]
) -> list[Layer]:
    """Returns the entries of the legend of a replay.

    Args:
        result: Result of the run.
        paths: Paths of the robots in the scene tree of Meshcat (Drake's 3D viewer), by
            name of the robot.
        estimates: Paths of the balls that show the estimated source position of each
            robot, by name of the robot.

    Returns:
        Entries of the legend. Entries without a switch come first.
    """
    return [
        *_bodies(result),
        *_of_sensors(result, paths, estimates),
        *_of_laws(result, paths),
        *_of_guards(result, paths),
        *_of_world(result, paths),
    ]


def _bodies(result: RunResult) -> list[Layer]:
    scenario, followed = result.full_scenario, followed_sources(result.full_scenario)
    found = [
        Layer(look.result.name, f"law {look.result.scenario.only.law}", (look.colour,))
        for look in looks(result)
    ]
    for name in scenario.sources:
        if name in followed:
            found.append(Layer(name, "what is followed", (COLOURS["source"],)))
        else:
            text = "emits sound, and the robot does not follow it"
            found.append(Layer(name, text, (COLOURS["interferer"],)))
    if scenario.obstacles:
        found.append(Layer("obstacles", "", (COLOURS["obstacle"],)))
    if any(own.collision for own in result.robots.values()):
        found.append(Layer("what was hit", "from then on", (COLOURS["hit"],)))
    return found


def _of_sensors(
    result: RunResult, paths: dict[str, str], estimates: dict[str, str]
) -> list[Layer]:
    found = []
    cones = [
        f"{paths[name]}/cone_{sensor + 1}"
        for name, own in result.robots.items()
        for sensor in logged_sensors(own)
    ]
    if cones:
        text = "ultrasonic; with or without an echo"
        both = COLOURS["echo"], COLOURS["empty"]
        found.append(Layer("cones", text, both, tuple(cones)))
    balls = [
        estimates[name]
        for name, own in result.robots.items()
        if own.scenario.only.searches is None
        and ("p_WS_estimated_x" in own.columns or own.scenario.only.kind == "router")
    ]
    if balls:
        colours = tuple(look.estimates for look in looks(result))
        routes = any(
            own.scenario.only.kind == "router" for own in result.robots.values()
        )
        text = (
            "the target on the route"
            if routes
            else ("where the robot assumes the source")
        )
        label = "targets" if routes else "estimates"
        found.append(Layer(label, text, colours, tuple(balls)))
    return found


def _of_laws(result: RunResult, paths: dict[str, str]) -> list[Layer]:
    m_per_n, found = scale_m_n(result), []
    forces = [
        arrow_path(paths[name], arrow.name)
        for name, own in result.robots.items()
        for arrow in arrows(own, m_per_n)
        if arrow.name != "law"
    ]
    if forces:
        text = f"attraction and repulsion; an arrow of {m_per_n:g} m is 1 N"
        colours = COLOURS["attraction"], COLOURS["repulsion"]
        found.append(Layer("forces", text, colours, tuple(forces)))
    laws = tuple(arrow_path(path, "law") for path in paths.values())
    if any(
        own.scenario.only.follow_distance_m and own.scenario.only.searches is None
        for own in result.robots.values()
    ):
        text, laws = "path of 1 s at the command; follow distance", (*laws, "follow")
    else:
        text = "path of 1 s at the command"
    return [*found, Layer("law", text, (COLOURS["law"],), laws)]


def _of_guards(result: RunResult, paths: dict[str, str]) -> list[Layer]:
    guarded = {
        name: own
        for name, own in result.robots.items()
        if own.scenario.only.own_guard is not None
    }
    if not guarded:
        return []
    circles = tuple(f"guard/{paths[name]}" for name in guarded)
    colours = COLOURS["passed"], COLOURS["lessened"], COLOURS["hit"]
    found = [Layer("guard", "passed the command, slowed, braked", colours, circles)]
    if any(has_known_space(own) for own in guarded.values()):
        own_looks = [look for look in looks(result) if look.result.name in guarded]
        shades = tuple(lightened(look.seen, 0.35) for look in own_looks)
        floors = tuple(f"known/{paths[name]}" for name in guarded)
        found.append(Layer("known floor", "seen as free; dots: echoes", shades, floors))
    if any(own.scenario.only.law == "guarded" for own in guarded.values()):
        rings = tuple(f"tracked/{paths[name]}" for name in guarded)
        text = "bodies that the robot takes as moving"
        found.append(Layer("tracked", text, (COLOURS["tracked"],), rings))
    return found


def _of_world(result: RunResult, paths: dict[str, str]) -> list[Layer]:
    scenario = result.full_scenario
    colours = tuple(look.colour for look in looks(result))
    found = [Layer("trails", "past positions", colours, ("trail",))]
    if scenario.room is not None:
        found.append(Layer("walls", "of the room", (COLOURS["wall"],), ("room",)))
    if scenario.odor is not None:
        found.append(Layer("odour", "the plume", (COLOURS["odor"],), ("odor",)))
    lamps = [
        path
        for name, robot in paths.items()
        if result.robots[name].scenario.only.searches is not None
        for path in (f"{robot}/lamp", f"{robot}/radio")
    ]
    if lamps:
        text = (
            "gray: at rest; yellow: senses; blue: moves; green: found; orange: gave up"
        )
        found.append(Layer("lamps", text, (COLOURS["sound"],), tuple(lamps)))
    adaptive = [
        f"{paths[name]}/{gain}"
        for name, own in result.robots.items()
        if own.scenario.only.kind == "router"
        for gain in ("stiffness", "damping", "contact_stiffness")
        if gain in own.columns
    ]
    if adaptive:
        colours = COLOURS["source"], COLOURS["robot"], COLOURS["obstacle"]
        text = "K, D and K_e; a bar of 15 cm is the initial value"
        found.append(Layer("gains", text, colours, tuple(adaptive)))
    return found
