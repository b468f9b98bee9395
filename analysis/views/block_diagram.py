"""Draws a block diagram with all blocks, the names of their ports, and all wires.

A wire is a connection from an output port to an input port. The module does not use
Graphviz, because the Python packages for Graphviz need system libraries that are not
installed on every machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import cycle
from pathlib import Path
from typing import Any

from pydrake.systems.framework import Diagram
from pydrake.systems.primitives import VectorLogSink

from systems.framework.block import STAGES, Stage, part_of

#: Fill color of the blocks of each stage.
FILLS: dict[Stage, str] = {
    "world": "#E8EEF4",
    "hearing": "#FBE3D6",
    "obstacle sensing": "#FCEFC9",
    "control": "#DDF1E7",
    "robot": "#DCEAF7",
}
#: Colors of the wires, which are dark enough for a white page. All wires from one block
#: have the same color.
WIRE_COLORS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#AA4499",
    "#B07D00",
    "#332288",
    "#000000",
    "#117733",
    "#CC3311",
    "#2B8CBE",
    "#7A5195",
    "#6B6B6B",
)
#: Sizes of the elements of the picture, px.
MARGIN, HEADER, ROW, TRACK, GAP, CHARACTER = 24, 42, 20, 9, 36, 6.7


@dataclass(frozen=True)
class Wire:
    """The names of two connected ports, and of their blocks."""

    source: str
    output: str
    target: str
    input: str


@dataclass
class _Box:
    """A block and its place in the picture."""

    name: str
    kind: str
    stage: Stage
    lower: bool
    """Whether the block is in the lower row of the picture."""
    inputs: list[str]
    outputs: list[str]
    column: int = 0
    x: float = 0.0
    y: float = 0.0

    @property
    def width(self) -> float:
        sides = max(map(len, self.inputs), default=0), max(map(len, self.outputs))
        longest = max(sum(sides) + 5, 1.2 * len(self.name) + 2, len(self.kind) + 2)
        return CHARACTER * longest

    @property
    def height(self) -> float:
        return HEADER + ROW * max(len(self.inputs), len(self.outputs)) + 6.0

    def port(self, name: str, *, output: bool) -> tuple[float, float]:
        """Returns the point (x, y) at which the wire of a port ends, px."""
        index = (self.outputs if output else self.inputs).index(name)
        x = self.x + (self.width if output else 0.0)
        return x, self.y + HEADER + ROW * (index + 0.5)


@dataclass
class _Layout:
    """The boxes and wires of the picture, with their places.

    A direct wire joins neighboring columns. All other wires go along the bus, a set of
    horizontal lines between the two rows of boxes. The wires from one output port share
    one line of the bus. The key of this line is (name of the block, name of the port).
    """

    boxes: dict[str, _Box]
    direct: list[Wire]
    bus: dict[tuple[str, str], list[Wire]]
    width: float = 0.0
    height: float = 0.0
    bus_y: dict[tuple[str, str], float] = field(default_factory=dict)
    track_x: dict[tuple[int, tuple[str, str]], float] = field(default_factory=dict)


def block_svg(diagram: Diagram, *, flat: bool = True) -> str:
    """Returns a picture of the block diagram as one SVG element.

    The signals go from left to right. Wires to a neighboring column are drawn directly.
    All other wires go along the bus, a set of horizontal lines between the two rows of
    blocks. The name of an output port is gray if no input port reads this output. Logs
    are left out. If ``flat`` is true, the blocks inside of nested diagrams are drawn.
    Otherwise, each nested diagram is drawn as one block.
    """
    connections = wires(diagram, flat=flat)
    layout = _arrange(blocks(diagram, flat=flat), connections)
    width, height = f"{layout.width:.0f}", f"{layout.height:.0f}"
    head = (
        # An SVG element without a width fills the window or page that shows it.
        '<svg xmlns="http://www.w3.org/2000/svg" '
        f'viewBox="0 0 {width} {height}" font-family="Helvetica, Arial, sans-serif">'
    )
    parts = [head, '<rect width="100%" height="100%" fill="white"/>']
    colors = dict(zip(layout.boxes, cycle(WIRE_COLORS), strict=False))
    parts += [_direct(layout, w, colors[w.source]) for w in layout.direct]
    for key, along in layout.bus.items():
        parts += [_along_bus(layout, key, wire, colors[key[0]]) for wire in along]
    read = {(w.source, w.output) for w in connections}
    parts += [_drawn(box, read) for box in layout.boxes.values()]
    return "\n".join([*parts, "</svg>", ""])


def write_block_diagram(
    diagram: Diagram, path: str | Path, *, flat: bool = True
) -> None:
    """Writes the picture of ``block_svg`` as an SVG file."""
    Path(path).write_text(block_svg(diagram, flat=flat), encoding="utf-8")


def _class_name(block: Any) -> str:
    """Returns the class name of a block, without the scalar type of a template."""
    return type(block).__name__.split("_\N{MATHEMATICAL BOLD SCRIPT CAPITAL T}")[0]


def _box(block: Any) -> _Box:
    stage: Stage = getattr(block, "stage", "control")
    if isinstance(block, Diagram):
        stage = "robot" if block.HasOutputPort("pose_WB") else "world"
    elif type(block).__module__.startswith("pydrake."):  # such a block joins ports
        stage = "world"
    return _Box(
        block.get_name(),
        _class_name(block),
        stage,
        part_of(block) == "obstacles" or stage == "obstacle sensing",
        [block.get_input_port(k).get_name() for k in range(block.num_input_ports())],
        [block.get_output_port(k).get_name() for k in range(block.num_output_ports())],
    )


def _arrange(systems: Sequence[Any], connections: Sequence[Wire]) -> _Layout:
    boxes = {block.get_name(): _box(block) for block in systems}
    _set_columns(boxes, connections)
    direct: list[Wire] = []
    bus: dict[tuple[str, str], list[Wire]] = {}
    for wire in connections:
        step = boxes[wire.target].column - boxes[wire.source].column
        lower = [boxes[n].lower for n in (wire.source, wire.target)]
        if step == 1 and (lower[0] == lower[1] or lower[0]):
            direct.append(wire)
        else:
            bus.setdefault((wire.source, wire.output), []).append(wire)
    layout = _Layout(boxes, direct, bus)
    _set_places(layout)
    return layout


def _set_columns(boxes: dict[str, _Box], connections: Iterable[Wire]) -> None:
    """Assigns each box to a column.

    A box is to the right of all boxes whose outputs it reads. It is then moved to the
    right as far as the boxes that read its own outputs permit. Boxes without inputs are
    not moved. These rules ignore wires that close a loop, and wires to a box of an
    earlier stage.
    """
    names = list(boxes)
    forward: dict[str, set[str]] = {name: set() for name in boxes}
    # Wires to a block that was added to the diagram earlier come last. In each loop,
    # such a wire is therefore the one that closes the loop.
    against = sorted(
        connections, key=lambda w: names.index(w.source) > names.index(w.target)
    )
    for wire in against:
        ranks = [STAGES.index(boxes[n].stage) for n in (wire.source, wire.target)]
        back = ranks[0] > ranks[1] or _reaches(forward, wire.target, wire.source)
        if not back:
            forward[wire.source].add(wire.target)
    for _ in boxes:
        for name, readers in forward.items():
            for reader in readers:
                box = boxes[reader]
                box.column = max(box.column, boxes[name].column + 1)
    for _ in boxes:
        for name, readers in forward.items():
            if readers and boxes[name].inputs:
                boxes[name].column = min(boxes[r].column for r in readers) - 1


def _reaches(forward: dict[str, set[str]], start: str, goal: str) -> bool:
    if start == goal:
        return True
    return any(_reaches(forward, after, goal) for after in forward[start])


def _set_places(layout: _Layout) -> None:
    boxes = layout.boxes.values()
    upper = [box for box in boxes if not box.lower]
    lower = [box for box in boxes if box.lower]
    _set_tracks(layout)
    top = MARGIN + 30.0
    below = _stack(upper, top)
    for index, key in enumerate(layout.bus):
        layout.bus_y[key] = below + GAP / 2.0 + TRACK * index
    floor = below + GAP + TRACK * len(layout.bus)
    layout.height = _stack(lower, floor) + MARGIN


def _stack(boxes: list[_Box], top: float) -> float:
    """Places boxes below each other in their columns, from the height ``top`` on, px.

    Returns the height of the lowest edge, px.
    """
    edges: dict[int, float] = {}
    for box in boxes:
        box.y = edges.get(box.column, top)
        edges[box.column] = box.y + box.height + GAP
    return max((edge - GAP for edge in edges.values()), default=top)


def _set_tracks(layout: _Layout) -> None:
    """Sets the x of all columns, and the x of the vertical parts of bus wires."""
    gaps: dict[int, list[tuple[str, str]]] = {}
    for key, along in layout.bus.items():
        columns = {layout.boxes[key[0]].column + 1}
        columns |= {layout.boxes[wire.target].column for wire in along}
        for column in columns:
            gaps.setdefault(column, []).append(key)
    x = float(MARGIN)
    last = max(box.column for box in layout.boxes.values())
    for column in range(last + 2):
        keys = gaps.get(column, [])
        for index, key in enumerate(keys):
            layout.track_x[column, key] = x + GAP / 2.0 + TRACK * index
        x += (GAP if column else 0.0) + TRACK * len(keys)
        members = [b for b in layout.boxes.values() if b.column == column]
        for box in members:
            box.x = x
        x += max((box.width for box in members), default=0.0)
    layout.width = x + MARGIN


def _direct(layout: _Layout, wire: Wire, color: str) -> str:
    x0, y0 = layout.boxes[wire.source].port(wire.output, output=True)
    x1, y1 = layout.boxes[wire.target].port(wire.input, output=False)
    bend = max(20.0, 0.5 * (x1 - x0))
    path = (
        f"M{x0:.1f},{y0:.1f} C{x0 + bend:.1f},{y0:.1f} "
        f"{x1 - bend:.1f},{y1:.1f} {x1:.1f},{y1:.1f}"
    )
    return _wire(wire, path, (x1, y1), color)


def _along_bus(layout: _Layout, key: tuple[str, str], wire: Wire, color: str) -> str:
    source, target = layout.boxes[wire.source], layout.boxes[wire.target]
    x0, y0 = source.port(wire.output, output=True)
    x1, y1 = target.port(wire.input, output=False)
    leave = layout.track_x[source.column + 1, key]
    arrive = layout.track_x[target.column, key]
    y = layout.bus_y[key]
    path = f"M{x0:.1f},{y0:.1f} H{leave:.1f} V{y:.1f} H{arrive:.1f} V{y1:.1f} H{x1:.1f}"
    return _wire(wire, path, (x1, y1), color)


def _wire(wire: Wire, path: str, end: tuple[float, float], color: str) -> str:
    name = f"{wire.source}.{wire.output} to {wire.target}.{wire.input}"
    return (
        f'<g class="wire"><title>{escape(name)}</title>'
        f'<path d="{path}" fill="none" stroke="{color}" stroke-width="1.5" '
        'stroke-linejoin="round"/>'
        f'<path d="M{end[0]:.1f},{end[1]:.1f} l-8,-4 v8 z" fill="{color}"/></g>'
    )


def _drawn(box: _Box, read: set[tuple[str, str]]) -> str:
    fill = FILLS[box.stage]
    middle = box.x + box.width / 2.0
    title = escape(box.name.replace("_", " "))
    frame = f'x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" stroke="#777777"'
    parts = [
        f'<g class="block"><rect {frame} height="{box.height:.1f}" fill="white"/>',
        f'<rect {frame} height="{HEADER - 4}" fill="{fill}"/>',
        _text(middle, box.y + 16, title, 13, "middle", "black", bold=True),
        _text(middle, box.y + 31, escape(box.kind), 11, "middle", "#444444"),
    ]
    for name in box.inputs:
        x, y = box.port(name, output=False)
        parts.append(_text(x + 6, y + 4, escape(name), 12, "start", "black"))
    for name in box.outputs:
        x, y = box.port(name, output=True)
        color = "black" if (box.name, name) in read else "#6B6B6B"
        parts.append(_text(x - 6, y + 4, escape(name), 12, "end", color))
    return "".join([*parts, "</g>"])


def _text(
    x: float,
    y: float,
    text: str,
    size: int,
    anchor: str,
    color: str,
    *,
    bold: bool = False,
) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" '
        f'fill="{color}"{weight}>{text}</text>'
    )


def blocks(diagram: Diagram, *, flat: bool = True) -> list[Any]:
    """Returns the systems of a diagram, except logs, in the order of the diagram.

    A system whose outputs only go to logs is also left out. If ``flat`` is true, the
    systems inside of a nested diagram replace this diagram in the result.
    """
    systems = list(_systems(diagram, flat=flat))
    logs = {s.get_name() for s in systems if isinstance(s, VectorLogSink)}
    readers: dict[str, set[str]] = {}
    for wire in _all_wires(diagram, flat=flat):
        readers.setdefault(wire.source, set()).add(wire.target)
    while more := {name for name, by in readers.items() if by <= logs} - logs:
        logs |= more
    return [s for s in systems if s.get_name() not in logs]


def wires(diagram: Diagram, *, flat: bool = True) -> list[Wire]:
    """Returns all wires between the systems that ``blocks`` returns.

    The wires are sorted by target block, input port, and source block.
    """
    names = [block.get_name() for block in blocks(diagram, flat=flat)]
    found = [wire for wire in _all_wires(diagram, flat=flat) if wire.target in names]
    return sorted(found, key=lambda w: (names.index(w.target), w.input, w.source))


def _systems(diagram: Diagram, *, flat: bool) -> Iterator[Any]:
    for system in diagram.GetSystems():
        if flat and isinstance(system, Diagram):
            yield from _systems(system, flat=True)
        else:
            yield system


def _all_wires(diagram: Diagram, *, flat: bool) -> list[Wire]:
    found = []
    for entry, exit_ in diagram.connection_map().items():
        writer, output = _writer(*exit_) if flat else exit_
        for reader, index in _readers(*entry) if flat else [entry]:
            found.append(
                Wire(
                    writer.get_name(),
                    writer.get_output_port(output).get_name(),
                    reader.get_name(),
                    reader.get_input_port(index).get_name(),
                )
            )
    for system in diagram.GetSystems() if flat else []:
        if isinstance(system, Diagram):
            found += _all_wires(system, flat=True)
    return found


def _writer(system: Any, index: Any) -> tuple[Any, Any]:
    """Returns the block that produces an output, and the index of its output port.

    ``index`` is the output port of ``system``. If ``system`` is a diagram, the block is
    inside of this diagram.
    """
    while isinstance(system, Diagram):
        system, index = system.get_output_port_locator(index)
    return system, index


def _readers(system: Any, index: Any) -> Iterator[tuple[Any, Any]]:
    """Yields the blocks that read an input, each with the index of its input port.

    ``index`` is the input port of ``system``. If ``system`` is a diagram, the blocks
    are inside of this diagram.
    """
    if not isinstance(system, Diagram):
        yield system, index
        return
    for inner in system.GetInputPortLocators(index):
        yield from _readers(*inner)
