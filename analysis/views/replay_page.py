"""Adds a clock, a legend, switches and curves to the page that Meshcat makes."""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from analysis.reporting.render import COLOURS_CSS

_HERE = Path(__file__).parent
#: Call in Meshcat's page that passes a message to the viewer.
_HANDLE = "viewer.handle_command_bytearray("
_SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0)


class Layer(NamedTuple):
    """An entry in the legend of a replay."""

    label: str
    meaning: str
    """Short explanation; may be empty."""
    colours: tuple[str, ...]
    """Colors of the sample beside the label."""
    paths: tuple[str, ...] = ()
    """Paths of objects in the scene tree of the 3D viewer. The switch of this entry
    hides these objects. If there are no paths, the entry has no switch."""


class ReplayFacts(NamedTuple):
    """Texts and data that the page shows in addition to the 3D scene."""

    title: str
    end_s: float
    bounds_m: tuple[float, float, float, float]
    """Part of the floor that must be in view: least x, greatest x, least y, greatest y,
    m."""
    layers: Sequence[Layer]
    charts: Sequence[Mapping[str, Any]]
    """Curves over time, from ``page_charts``."""
    names: Sequence[tuple[str, str]]
    """Pairs of a path in the scene tree of the 3D viewer, and the name of the object at
    this path."""
    robots: Sequence[tuple[str, str]]
    """Pairs of path and name of each robot that the view can follow."""
    warnings: Sequence[str] = ()
    """Warnings about the scenario, which the page shows below the legend."""


def replay_page(meshcat_page: str, facts: ReplayFacts) -> str:
    """Returns the page of Meshcat (Drake's 3D viewer) with added controls and charts.

    Args:
        meshcat_page: HTML text from ``Meshcat.StaticHtml``.
        facts: Texts and data that the page shows in addition to the scene.

    Returns:
        HTML text of a page that needs no network.
    """
    data = {
        "end_s": facts.end_s,
        "bounds_m": facts.bounds_m,
        "names": facts.names,
        "charts": facts.charts,
    }
    # The replacement prevents a text of the scenario from ending the script early.
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace(
        "<", "\\u003c"
    )
    title = html.escape(facts.title)
    head = (
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<link rel="icon" href="data:,"><title>{title} - replay</title>'
    )
    style = f"{COLOURS_CSS}\n{(_HERE / 'replay.css').read_text('utf-8')}"
    script = (_HERE / "replay.js").read_text("utf-8")
    # The messages to the scene arrive one by one. The page waits for the last message.
    messages = meshcat_page.count(_HANDLE)
    waiting = (
        f"<script>let messagesLeft = {messages}; function handleMessage(bytes) "
        f"{{ {_HANDLE}bytes); messagesLeft -= 1; }}</script>"
    )
    meshcat_page = meshcat_page.replace(_HANDLE, "handleMessage(")
    before, scene, after = meshcat_page.partition('<div id="meshcat-pane">')
    start, _, end = after.rpartition("</body>")
    before = before.replace("<html>", '<html lang="en">', 1)
    opening, _, rest = before.partition("<title>")
    return "".join(
        [
            opening,
            head,
            rest.partition("</title>")[2],
            f"<header><h1>{title}</h1></header>",
            scene.replace(">", ' role="img" aria-label="The run in three dimensions">'),
            waiting,
            start,
            *_panels(facts),
            f"<style>{style}</style>",
            f'<script type="application/json" id="replay-facts">{text}</script>',
            f"<script>{script}</script>",
            "</body>",
            end,
        ]
    )


def _panels(facts: ReplayFacts) -> Iterator[str]:
    speeds = "".join(
        f'<option value="{x:g}"{" selected" if x == 1.0 else ""}>{x:g} \u00d7</option>'
        for x in _SPEEDS
    )
    views = "".join(
        f'<option value="{html.escape(path)}">follow {html.escape(name)}</option>'
        for path, name in facts.robots
    )
    yield (
        '<div class="clock" role="group" aria-label="Time and view">'
        '<button type="button" id="play" class="play">\u25b6 Play</button>'
        '<button type="button" id="restart">\u21e4 Start</button>'
        f'<input type="range" id="time" min="0" max="{facts.end_s:g}" step="0.025" '
        'value="0" aria-label="Time">'
        f'<output id="clock">0.00 / {facts.end_s:.2f} s</output>'
        f'<select id="speed" aria-label="Speed">{speeds}</select>'
        '<select id="view" aria-label="View"><option value="all">whole run</option>'
        f'<option value="above">from above</option>{views}</select>'
        '<button type="button" id="nearer" aria-label="Nearer">+</button>'
        '<button type="button" id="farther" aria-label="Farther">\u2212</button>'
        "</div>"
    )
    plain = "".join(_entry(layer) for layer in facts.layers if not layer.paths)
    switched = "".join(_entry(layer) for layer in facts.layers if layer.paths)
    names = '<li><label><input type="checkbox" checked><span></span>names</label></li>'
    lines = "".join(f"<li>{html.escape(text)}</li>" for text in facts.warnings)
    warnings = f"<h2>Warnings</h2><ul>{lines}</ul>" if lines else ""
    yield (
        f'<aside aria-label="Legend"><h2>Legend</h2><ul>{plain}</ul>'
        f"<h2>Show</h2><ul>{switched}{names}</ul>{warnings}</aside>"
    )
    chart = (
        '<div class="chart"><select aria-label="Quantity">'
        f"{_quantities(facts)}</select>"
        '<svg role="img" aria-label="The quantity over time; click to go there"></svg>'
        '<div class="readings"></div></div>'
    )
    yield f'<div class="charts">{2 * chart}</div>'


def _entry(layer: Layer) -> str:
    parts = "".join(f'<i style="background:{colour}"></i>' for colour in layer.colours)
    swatch = f'<span class="swatch">{parts}</span>'
    label, small = (
        html.escape(layer.label),
        f"<small>{html.escape(layer.meaning)}</small>",
    )
    if not layer.paths:
        return f"<li>{swatch}{label}{small if layer.meaning else ''}</li>"
    paths = html.escape(json.dumps(layer.paths))
    box = f'<input type="checkbox" checked data-paths="{paths}">'
    return f"<li><label>{box}{swatch}<span>{label}</span>{small}</label></li>"


def _whose(chart: Mapping[str, Any]) -> str:
    robot, title = chart["robot"], chart["title"]
    return f"{robot}: {title}" if robot else title


def _quantities(facts: ReplayFacts) -> str:
    options = []
    for robot, charts in groupby(
        enumerate(facts.charts), lambda pair: pair[1]["robot"]
    ):
        inner = "".join(
            # Each option contains the robot's name, because a closed list hides groups.
            f'<option value="{k}">{html.escape(_whose(chart))}</option>'
            for k, chart in charts
        )
        label = html.escape(robot)
        options.append(
            f'<optgroup label="{label}">{inner}</optgroup>' if robot else inner
        )
    return "".join(options)
