"""The block diagram shows every block, port and wire, and no log."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Gain, LogVectorOutput

from analysis.views.block_diagram import Wire, block_svg, wires, write_block_diagram
from diagrams import build_sound_follower, load_scenario

pytestmark = pytest.mark.drake

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def follower():
    return build_sound_follower(load_scenario("default"), log=True)


@pytest.fixture(scope="module")
def picture(follower, tmp_path_factory):
    path = tmp_path_factory.mktemp("diagram") / "diagram.svg"
    write_block_diagram(follower.diagram, path)
    return ET.parse(path).getroot()


def _ports(block):
    for k in range(block.num_input_ports()):
        yield block.get_input_port(k).get_name()
    for k in range(block.num_output_ports()):
        yield block.get_output_port(k).get_name()


def _groups(picture, kind):
    return [g for g in picture.iter(f"{SVG}g") if g.get("class") == kind]


def _texts(group):
    return [t.text for t in group.iter(f"{SVG}text")]


def _boxes(picture):
    """(x, y, width, height) of each block, by its title."""
    boxes = {}
    for group in _groups(picture, "block"):
        frame = group.find(f"{SVG}rect")
        boxes[_texts(group)[0]] = tuple(
            float(frame.get(key)) for key in ("x", "y", "width", "height")
        )
    return boxes


def test_it_scales_with_what_shows_it(picture):
    assert picture.get("width") is None
    assert len(picture.get("viewBox").split()) == 4


def test_every_input_port_has_one_wire_from_a_port_of_its_name(follower):
    found = wires(follower.diagram)
    blocks = follower.blocks.values()
    inputs = {
        (block.get_name(), block.get_input_port(k).get_name())
        for block in blocks
        for k in range(block.num_input_ports())
    }
    assert {(wire.target, wire.input) for wire in found} == inputs
    assert len(found) == len(inputs)
    assert all(wire.output == wire.input for wire in found)


def test_logs_leave_no_trace(follower):
    plain = build_sound_follower(follower.scenario)
    assert wires(follower.diagram) == wires(plain.diagram)


def test_a_block_read_by_a_log_alone_is_a_block_of_the_logs():
    builder = DiagramBuilder()
    for name in ("first", "second", "for_the_log"):
        builder.AddNamedSystem(name, Gain(2.0, 1))
    first, second, logged = builder.GetSystems()
    builder.Connect(first.get_output_port(), second.get_input_port())
    builder.Connect(first.get_output_port(), logged.get_input_port())
    builder.ExportInput(first.get_input_port(), "u")
    LogVectorOutput(logged.get_output_port(), builder)
    diagram = builder.Build()
    assert wires(diagram) == [Wire("first", "y0", "second", "u0")]
    assert "for the log" not in block_svg(diagram)


def test_each_block_shows_its_name_and_all_its_ports(follower, picture):
    shown = {_texts(g)[0]: _texts(g)[2:] for g in _groups(picture, "block")}
    for block in follower.blocks.values():
        title = block.get_name().replace("_", " ")
        assert sorted(shown.pop(title)) == sorted(_ports(block))
    assert shown == {}


def test_each_wire_is_drawn_in_the_color_of_its_block(follower, picture):
    colors: dict[str, set[str]] = {}
    groups = _groups(picture, "wire")
    assert len(groups) == len(wires(follower.diagram))
    for group in groups:
        source = group.find(f"{SVG}title").text.split(".")[0]
        colors.setdefault(source, set()).add(group.find(f"{SVG}path").get("stroke"))
    assert all(len(found) == 1 for found in colors.values())
    assert len(set.union(*colors.values())) == len(colors)


def test_each_wire_ends_on_the_edges_of_its_blocks(follower, picture):
    boxes = _boxes(picture)
    for group in _groups(picture, "wire"):
        title = group.find(f"{SVG}title").text
        source, target = (end.split(".")[0] for end in title.split(" to "))
        numbers = re.findall(r"[-\d.]+", group.find(f"{SVG}path").get("d"))
        x0, y0 = map(float, numbers[:2])
        arrow = group.findall(f"{SVG}path")[1].get("d")
        x1, y1 = map(float, re.findall(r"[-\d.]+", arrow)[:2])
        left, top, width, height = boxes[source.replace("_", " ")]
        assert x0 == pytest.approx(left + width, abs=0.11)
        assert top < y0 < top + height
        left, top, width, height = boxes[target.replace("_", " ")]
        assert x1 == pytest.approx(left, abs=0.11)
        assert top < y1 < top + height


def test_no_two_blocks_overlap_and_all_are_on_the_page(picture):
    boxes = list(_boxes(picture).values())
    page = [float(size) for size in picture.get("viewBox").split()[2:]]
    for k, (x, y, width, height) in enumerate(boxes):
        assert min(x, y) > 0
        assert x + width < page[0]
        assert y + height < page[1]
        for other in boxes[:k]:
            apart_x = x > other[0] + other[2] or other[0] > x + width
            apart_y = y > other[1] + other[3] or other[1] > y + height
            assert apart_x or apart_y


def test_it_runs_from_left_to_right(picture):
    boxes = _boxes(picture)
    chain = (
        "source robot",
        "sound emitter",
        "mic array",
        "tdoa estimator",
        "source tracker",
        "active impedance controller",
        "wheel command",
        "diff drive plant",
        "wheel odometry",
    )
    places = [boxes[name][0] for name in chain]
    assert places == sorted(places)


@pytest.mark.parametrize("law", ["none", "conventional"])
def test_other_builds_are_drawn_too(law):
    ideal = ["hearing=ideal", "obstacle_sensing=ideal", f"law={law}"]
    follower = build_sound_follower(load_scenario("default", ideal))
    root = ET.fromstring(block_svg(follower.diagram))
    assert len(_boxes(root)) == len(follower.blocks)
