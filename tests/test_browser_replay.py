"""The replay draws and moves in a browser that has no network, and obeys its user."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from analysis.runs.proximity import Proximity
from analysis.views.replay import write_replay
from diagrams import load_scenario, simulate

pytestmark = [pytest.mark.browser, pytest.mark.slow]

#: Animation times of the two pictures, s; the source is silent in both.
EARLY_S, LATE_S = 0.8, 5.8
READY = "body[data-ready=yes]"
#: Of a telephone, and of two windows, px.
WIDTHS = (390, 1100, 1400)


def _scene(page: Any, time: float) -> np.ndarray:
    """(rows, columns, 3) the scene at a time, in 0..1."""
    page.evaluate(f"replay.seek({time})")
    # The scene is drawn with the next picture of the screen.
    page.evaluate("new Promise((f) => requestAnimationFrame(() => setTimeout(f, 50)))")
    shot = page.locator("#meshcat-pane").screenshot()
    return np.asarray(imread(io.BytesIO(shot)))[:, :, :3]


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    result = simulate(load_scenario("default", ["hearing=ideal", "duration_s=6"]))
    write_replay(result, path, {"robot": Proximity(result).clearance})
    return path


@pytest.fixture
def page(browser: Any, replay: Path) -> Iterator[Any]:
    """The replay, at rest at its start, without names over its bodies."""
    opened = _opened(browser, replay)
    opened.get_by_label("names").uncheck()
    yield opened
    opened.context.close()


def _opened(browser: Any, path: Path, place: str = "") -> Any:
    context = browser.new_context(
        viewport={"width": 900, "height": 700}, reduced_motion="reduce", offline=True
    )
    opened = context.new_page()
    opened.goto(path.as_uri() + place)
    opened.wait_for_selector(READY)
    return opened


@pytest.fixture
def pictures(page: Any) -> list[np.ndarray]:
    return [_scene(page, time) for time in (EARLY_S, LATE_S)]


def _place(picture: np.ndarray, channel: int) -> np.ndarray:
    """Mean column and row of the pixels in which one color rules."""
    others = np.delete(picture, channel, axis=2).max(axis=2)
    rows, columns = np.nonzero(picture[:, :, channel] > others + 0.25)
    assert len(rows) > 50, "the body of this color is not in the picture"
    return np.array([columns.mean(), rows.mean()])


def test_both_pictures_show_a_scene_that_moves(pictures):
    for picture in pictures:
        levels = np.unique((picture * 255.0).astype(int).reshape(-1, 3), axis=0)
        assert len(levels) > 50
        assert picture.std() > 0.02
    early, late = pictures
    assert (np.abs(late - early).max(axis=2) > 0.1).mean() > 0.002


def test_the_source_drives_to_the_right_and_the_robot_after_it(pictures):
    # x of W is to the right; the source is orange, the robot blue.
    early, late = pictures
    assert _place(late, 0)[0] > _place(early, 0)[0] + 20.0
    assert _place(late, 2)[0] > _place(early, 2)[0] + 20.0


def test_it_does_at_all_widths_by_day_and_by_night(replay, check_page):
    check_page(replay, READY)


def test_play_moves_the_clock_and_pause_holds_it(page):
    play, clock = page.locator("#play"), page.locator("#clock")
    assert clock.inner_text() == "0.00 / 6.00 s"
    play.click()
    page.wait_for_function("replay.time > 0.3")
    page.keyboard.press("Space")  # the button has the focus
    held = page.evaluate("replay.time")
    page.wait_for_timeout(200)
    assert page.evaluate("replay.time") == held
    page.locator("#restart").click()
    assert page.evaluate("replay.time") == 0.0


def test_the_slider_and_the_curves_move_the_scene(page):
    page.locator("#time").focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    assert page.evaluate("replay.time") == pytest.approx(0.1)
    curve = page.locator(".chart svg").first
    box = curve.bounding_box()
    # The middle of the axis, which has 44 px on its left and 8 px on its right.
    middle = 44.0 + (box["width"] - 52.0) / 2.0
    curve.click(position={"x": middle, "y": 40.0})
    assert page.evaluate("replay.time") == pytest.approx(3.0, abs=0.02)
    cursor = page.locator(".chart svg").first.locator(".cursor")
    assert float(cursor.get_attribute("x1")) == pytest.approx(middle, abs=1.0)


def test_the_reading_is_the_curve_under_the_cursor(page, browser):
    page.evaluate("replay.seek(4.0)")
    facts = page.evaluate(
        "JSON.parse(document.getElementById('replay-facts').textContent).charts[0]"
    )
    true = next(series for series in facts["series"] if series["label"] == "true")
    value = true["values"][int(np.searchsorted(true["t"], 4.0 + 1e-9)) - 1]
    shown = page.locator(".readings").first.inner_text()
    assert f"true {value:.2f}" in shown


@pytest.mark.parametrize("layer", ["cones", "forces", "law", "estimates", "trails"])
def test_a_layer_can_be_switched_off_and_on(page, layer):
    before = _scene(page, LATE_S)
    page.get_by_label(layer).uncheck()
    without = _scene(page, LATE_S)
    assert (np.abs(without - before).max(axis=2) > 0.05).sum() > 20
    page.get_by_label(layer).check()
    np.testing.assert_allclose(_scene(page, LATE_S), before, atol=0.02)


def test_the_view_can_follow_the_robot_and_come_back(page):
    whole = _place(_scene(page, EARLY_S), 2)
    page.locator("#view").select_option(label="follow robot")
    places = [_place(_scene(page, time), 2) for time in (EARLY_S, LATE_S)]
    assert np.abs(places[0] - places[1]).max() < 40.0
    page.locator("#view").select_option(label="whole run")
    np.testing.assert_allclose(_place(_scene(page, EARLY_S), 2), whole, atol=1.0)


@pytest.mark.parametrize("width", WIDTHS)
def test_no_number_of_the_floor_is_cut(browser, replay, width):
    """Every corner of every number is in the first view; its letters can be read."""
    context = browser.new_context(viewport={"width": width, "height": 844})
    opened = context.new_page()
    opened.goto(replay.as_uri())
    opened.wait_for_selector(READY)
    numbers = opened.evaluate(
        """() => { viewer.scene.updateMatrixWorld();
        const {Box3, Vector3} = MeshCat.THREE, found = {};
        const pane = document.getElementById("meshcat-pane");
        const wanted = /^x -?\\d+$/, floor = replay.shown("floor");
        const named = floor.children.filter((child) => wanted.test(child.name));
        for (const number of named) {
          const {min, max} = new Box3().setFromObject(number);
          const ends = [[min.x, min.z], [max.x, min.z], [min.x, max.z], [max.x, max.z]]
            .map(([x, z]) => new Vector3(x, min.y, z).project(viewer.camera));
          const far = ends.flatMap(({x, y}) => [Math.abs(x), Math.abs(y)]);
          const rows = ends.map(({y}) => y * pane.clientHeight / 2);
          found[number.name] = [Math.max(...far),
            Math.max(...rows) - Math.min(...rows)];
        }
        return found; }"""
    )
    # The robot starts with its axle at 0, and the source drives 1.8 m ahead of it.
    assert {"x 0", "x 1", "x 2"} <= numbers.keys()
    assert max(edge for edge, _ in numbers.values()) < 1.0
    assert min(height for _, height in numbers.values()) > 6.0
    context.close()


@pytest.mark.parametrize("width", [390, 1100])
def test_the_whole_run_is_in_view(browser, replay, width):
    context = browser.new_context(viewport={"width": width, "height": 844})
    opened = context.new_page()
    opened.goto(replay.as_uri())
    opened.wait_for_selector(READY)
    for body, time in (("robot", 0.0), ("robot", 6.0), ("source", 6.0)):
        opened.evaluate(f"replay.setPlaying(false); replay.seek({time})")
        place = opened.evaluate(
            """(body) => { viewer.scene.updateMatrixWorld();
            const p = new MeshCat.THREE.Vector3().setFromMatrixPosition(
                replay.shown(body).matrixWorld).project(viewer.camera);
            return [p.x, p.y]; }""",
            body,
        )
        assert np.abs(place).max() < 1.0
    context.close()


def test_an_address_can_name_a_time(browser, replay):
    opened = _opened(browser, replay, "#t=2.5")
    assert opened.evaluate("replay.time") == 2.5
    assert opened.locator("#clock").inner_text() == "2.50 / 6.00 s"
    opened.context.close()


def test_walls_sources_robots_and_what_was_hit_are_shown(
    browser: Any, tmp_path: Path
) -> None:
    """Two robots in a room, one of which drives into a box; and a radio."""
    overrides = [
        "law=none",
        "duration_s=8",
        "room={size_m: [8.0, 8.0, 3.0], corner_m: [-2.5, -2.5]}",
        "robots={first: {}, second: {start: {position_m: [-1.5, 0.0]}}}",
        "sources={leader: {}, radio: {body: false, waypoints_m: [[3, 3]]}}",
        "obstacles=[{name: box, size_m: [0.3, 0.3], waypoints_m: [[1.0, 0.3]]}]",
        "source.waypoints_m=[[3, 0]]",
    ]
    result = simulate(load_scenario("default", overrides))
    assert result.collision is not None
    assert result.collision.object == "box"
    write_replay(result, tmp_path / "replay.html")
    opened = _opened(browser, tmp_path / "replay.html")
    legend = opened.locator("aside").inner_text()
    for entry in ("first", "second", "leader", "radio", "walls", "what was hit"):
        assert entry in legend
    names = opened.locator(".name:visible").all_inner_texts()
    assert {"first", "second", "leader", "radio", "box"} <= set(names)
    for path in ("room/wall_0", "room/wall_3", "sources/radio", "robots/second"):
        assert opened.evaluate(f"replay.shown('{path}').children.length") > 0
    end = result.simulated_s
    for path in ("obstacles/box/hit", "collision/robots/first"):
        for time, seen in ((0.0, False), (end, True)):
            opened.evaluate(f"replay.seek({time})")
            assert opened.evaluate(f"replay.shown('{path}').visible") == seen
    opened.context.close()


def test_the_floor_that_is_known_grows(tmp_path: Path, browser: Any) -> None:
    """It is light green, on a floor of gray; the robot drives into the open."""
    overrides = ["hearing=ideal", "guard={}", "duration_s=4"]
    result = simulate(load_scenario("two_static_obstacles", overrides))
    write_replay(result, tmp_path / "replay.html")
    opened, shares = _opened(browser, tmp_path / "replay.html"), []
    for time in (0.3, 3.8):
        red, green, blue = np.moveaxis(_scene(opened, time), 2, 0)
        greenish = (green > red + 0.06) & (green > blue + 0.005) & (green > 0.6)
        shares.append(greenish.mean())
    opened.context.close()
    assert shares[0] > 0.02
    assert shares[1] > 1.5 * shares[0]


def test_what_a_guard_did_is_drawn_and_named(tmp_path: Path, browser: Any) -> None:
    overrides = ["hearing=ideal", "guard={}", "duration_s=2"]
    result = simulate(load_scenario("two_static_obstacles", overrides))
    write_replay(result, tmp_path / "replay.html")
    opened = _opened(browser, tmp_path / "replay.html")
    chart = opened.locator(".chart").first
    chart.locator("select").select_option(label="command, by the guard")
    drawn = chart.locator(".curves path[stroke]").get_attribute("d")
    assert drawn.startswith("M")
    assert "H" in drawn
    opened.evaluate("replay.seek(1.5)")
    did = result.columns["guard_action"][round(1.5 / 0.025)]
    name = ("passed", "slowed", "turned", "braked", "halted")[round(did)]
    assert chart.locator(".readings").inner_text().endswith(name)
    opened.context.close()


@pytest.mark.parametrize(
    "bad",
    [
        "<script>nowhere()</script>",
        '<div style="width: 2000px">wide</div>',
        '<p style="color: #aaa; background: #fff">pale</p>',
        '<a href="#" tabindex="-1">skipped</a>',
        '<button style="outline: none">nowhere to be seen</button>',
    ],
)
def test_a_page_that_fails_would_be_seen(tmp_path, check_page, bad):
    path = tmp_path / "bad.html"
    path.write_text(f'<!DOCTYPE html><html lang="en"><title>page</title><body>{bad}')
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        check_page(path)
