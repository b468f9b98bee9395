"""Adds a clock, a legend, switches and curves to the page that Meshcat makes."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from analysis.report.render import COLORS_CSS
from analysis.views.framing import run_title, shown_rectangle
from analysis.views.scene import Layer, Obstacle, Scene, Thing

_HERE = Path(__file__).parent
#: Largest number of obstacles whose names a replay shows.
_MOST_NAMES = 30
#: Beginning of the call in Meshcat's page that passes a message to the viewer.
_HANDLE = "viewer.handle_command_bytearray("
_SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)


def replay_page(
    meshcat_page: str,
    scene: Scene,
    layers: Sequence[Layer],
    charts: Sequence[Mapping[str, Any]],
) -> str:
    """Returns the page of Meshcat (Drake's 3D viewer) with added controls and charts.

    ``meshcat_page`` is the result of ``Meshcat.StaticHtml``. Each of the ``layers`` is
    an entry of the legend. ``charts`` are those of ``page_charts``. The page needs no
    network.
    """
    result = scene.result
    data = {
        "end_s": result.simulated_s,
        "bounds_m": shown_rectangle(result),
        "names": _names([*scene.bodies.values()]),
        "charts": charts,
    }
    # Without the replacement, a text of the scenario that contains "</script>" would
    # end the script.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace(
        "<", "\\u003c"
    )
    title = html.escape(run_title(result))
    head = (
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{title} - replay</title>'
    )
    style = f"{COLORS_CSS}\n{(_HERE / 'replay.css').read_text('utf-8')}"
    script = (_HERE / "replay.js").read_text("utf-8")
    # The page passes its messages to the viewer one by one. ``messagesLeft`` is 0 when
    # the scene is complete.
    messages = meshcat_page.count(_HANDLE)
    waiting = (
        f"<script>let messagesLeft = {messages}; function handleMessage(bytes) "
        f"{{ {_HANDLE}bytes); messagesLeft -= 1; }}</script>"
    )
    meshcat_page = meshcat_page.replace(_HANDLE, "handleMessage(")
    before, pane, after = meshcat_page.partition('<div id="meshcat-pane">')
    start, _, end = after.rpartition("</body>")
    before = before.replace("<html>", '<html lang="en">', 1)
    opening, _, rest = before.partition("<title>")
    return "".join(
        [
            opening,
            head,
            rest.partition("</title>")[2],
            f"<header><h1>{title}</h1></header>",
            pane.replace(">", ' role="img" aria-label="The run in three dimensions">'),
            waiting,
            start,
            *_panels(scene, layers, charts),
            f"<style>{style}</style>",
            f'<script type="application/json" id="replay-facts">{text}</script>',
            f"<script>{script}</script>",
            "</body>",
            end,
        ]
    )


def _names(bodies: Sequence[Thing]) -> list[tuple[str, str, float, float]]:
    """Returns path and name of bodies, and x and y of the labels in their axes, m.

    The labels of many obstacles would hide the scene, so that they are left out.
    """
    obstacles = [body for body in bodies if isinstance(body.shape, Obstacle)]
    crowded = len(obstacles) > _MOST_NAMES
    found = []
    for body in bodies:
        solid, (x, y) = body.shape, (0.0, 0.0)
        if isinstance(solid, Obstacle):
            if crowded:
                continue
            x, y = solid.shape.middle
        found.append((body.path, body.name, x, y))
    return found


def _panels(
    scene: Scene, layers: Sequence[Layer], charts: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    result, end_s = scene.result, scene.result.simulated_s
    robots = [scene.bodies[name] for name in result.robots]
    speeds = "".join(
        f'<option value="{x:g}"{" selected" if x == 1.0 else ""}>{x:g} \u00d7</option>'
        for x in _SPEEDS
    )
    views = "".join(
        f'<option value="{html.escape(body.path)}">follow {html.escape(body.name)}'
        "</option>"
        for body in robots
    )
    yield (
        '<div class="clock" role="group" aria-label="Time and view">'
        '<button type="button" id="play" class="play">\u25b6 Play</button>'
        '<button type="button" id="restart">\u21e4 Start</button>'
        f'<input type="range" id="time" min="0" max="{end_s:g}" step="0.025" '
        'value="0" aria-label="Time">'
        f'<output id="clock">0.00 / {end_s:.2f} s</output>'
        f'<select id="speed" aria-label="Speed">{speeds}</select>'
        '<select id="view" aria-label="View"><option value="all">whole run</option>'
        f'<option value="above">from above</option>{views}</select>'
        '<button type="button" id="nearer" aria-label="Nearer">+</button>'
        '<button type="button" id="farther" aria-label="Farther">\u2212</button>'
        "</div>"
    )
    plain = "".join(_entry(layer) for layer in layers if not layer.switched)
    switched = "".join(_entry(layer) for layer in layers if layer.switched)
    names = '<li><label><input type="checkbox" checked><span></span>names</label></li>'
    lines = "".join(f"<li>{html.escape(str(each))}</li>" for each in result.warnings)
    warnings = f"<h2>Warnings</h2><ul>{lines}</ul>" if lines else ""
    yield (
        f'<aside aria-label="Legend"><h2>Legend</h2><ul>{plain}</ul>'
        f"<h2>Show</h2><ul>{switched}{names}</ul>{warnings}</aside>"
    )
    chart = (
        '<div class="chart"><select aria-label="Quantity">'
        f"{_quantities(charts)}</select>"
        '<svg role="img" aria-label="The quantity over time; click to go there"></svg>'
        '<div class="readings"></div></div>'
    )
    yield f'<div class="charts">{2 * chart}</div>'


def _entry(layer: Layer) -> str:
    parts = "".join(f'<i style="background:{color}"></i>' for color in layer.colors)
    swatch = f'<span class="swatch">{parts}</span>'
    label = html.escape(layer.label)
    small = f"<small>{html.escape(layer.meaning)}</small>"
    if not layer.switched:
        return f"<li>{swatch}{label}{small if layer.meaning else ''}</li>"
    paths = html.escape(json.dumps(_hidden(layer)))
    box = f'<input type="checkbox" checked data-paths="{paths}">'
    return f"<li><label>{box}{swatch}<span>{label}</span>{small}</label></li>"


def _hidden(layer: Layer) -> list[str]:
    """Returns the paths that the switch of a layer hides.

    A path below another path of the layer is left out, because hiding a path also hides
    everything below it.
    """
    paths = [thing.path for thing in layer.things]
    return [
        path
        for path in paths
        if not any(path.startswith(f"{above}/") for above in paths)
    ]


def _whose(chart: Mapping[str, Any]) -> str:
    robot, title = chart["robot"], chart["title"]
    return f"{robot}: {title}" if robot else title


def _quantities(charts: Sequence[Mapping[str, Any]]) -> str:
    options = []
    for robot, own in groupby(enumerate(charts), lambda pair: pair[1]["robot"]):
        inner = "".join(
            # Each option contains the name of its robot, because a closed list shows
            # only the option and not its group.
            f'<option value="{k}">{html.escape(_whose(chart))}</option>'
            for k, chart in own
        )
        label = html.escape(robot)
        options.append(
            f'<optgroup label="{label}">{inner}</optgroup>' if robot else inner
        )
    return "".join(options)
