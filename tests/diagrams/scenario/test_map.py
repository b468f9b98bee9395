"""A map in a scenario is one obstacle for sensors, contacts, and results."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from diagrams import load_scenario, simulate, write_scenario
from systems.framework.input_error import InputError
from systems.routes.widest_route import plan_route

#: A wall from x = 2 to 2.2 m, made of two rectangles: 4 m long with a notch.
WALL = {"origin": "[-1.0, -3.0, 0.0]", "resolution": 0.1}


@pytest.fixture
def scenario_file(tmp_path):
    cells = np.full((60, 50), 254, dtype=np.uint8)
    cells[10:50, 30:32] = 0
    cells[20:25, 30] = 254
    Image.fromarray(cells).save(tmp_path / "wall.pgm")
    (tmp_path / "wall.yaml").write_text(
        "image: wall.pgm\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        + "".join(f"{k}: {v}\n" for k, v in WALL.items()),
        "utf-8",
    )
    file = tmp_path / "walled.yaml"
    file.write_text(
        "map: {file: wall.yaml}\nhearing: ideal_always\nlaw: conventional\n"
        "source: {waypoints_m: [[3.5, 0.0]]}\nduration_s: 12\n"
        "ultrasonic: {noise_m: 0}\nlaws: {conventional: {reach_m: 0.02}}\n",
        "utf-8",
    )
    return file


def boxes(rectangles):
    """Obstacles at the places of rectangles (x, y, theta, length, width, radius)."""
    return [
        {"name": f"w{k}", "waypoints_m": [[x, y]], "size_m": [length, width]}
        for k, (x, y, _, length, width, _) in enumerate(rectangles)
    ]


def test_a_map_is_one_obstacle_made_of_boxes(scenario_file):
    """The robot hits boxes at the same places at the same time, in both engines."""
    mapped = load_scenario(scenario_file)
    (body,) = mapped.surroundings().obstacles.values()
    rectangles = body.rectangles(0.0)
    assert len(rectangles) == 3
    boxed = mapped.with_(map=None, obstacles=boxes(rectangles.tolist()))
    runs = [
        simulate(each.with_(engine=engine))
        for each in (mapped, boxed)
        for engine in ("drake", "compiled")
    ]
    for run in runs[1:]:
        for name, column in runs[0].columns.items():
            np.testing.assert_allclose(run.columns[name], column, atol=1e-9)
    assert runs[0].collision is not None
    assert [run.collision.object for run in runs if run.collision][:2] == ["map"] * 2


def test_a_result_directory_has_a_copy_of_the_map(scenario_file, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    scenario = load_scenario(scenario_file)
    write_scenario(scenario, out)
    rectangles, others = scenario.mapped(), scenario.with_(map=None)
    (tmp_path / "wall.pgm").unlink()
    moved = out.rename(tmp_path / "moved")
    again = load_scenario(moved)
    np.testing.assert_array_equal(again.mapped(), rectangles)
    assert again.with_(map=None) == others


def test_an_unknown_map_is_not_on_the_map_for_routes(scenario_file):
    assert len(load_scenario(scenario_file).mapped()) == 3
    assert len(load_scenario(scenario_file, {"map.known": False}).mapped()) == 0


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"start.position_m": [1.9, 0.0]}, "start.position_m"),
        ({"source.waypoints_m": [[3.0, 0.0], [2.15, 0.0]]}, "source.waypoints_m"),
        (
            {"obstacles": [{"waypoints_m": [[3.0, 1.0], [2.15, 0.0]]}]},
            "obstacles.0.waypoints_m",
        ),
    ],
)
def test_a_place_inside_a_wall_is_refused(scenario_file, changes, field):
    with pytest.raises(InputError, match=r"an occupied cell of the map.*move") as error:
        load_scenario(scenario_file, changes)
    assert error.value.field == field


def test_a_goal_inside_a_wall_is_refused(tmp_path, scenario_file):
    file = tmp_path / "routed.yaml"
    file.write_text("map: {file: wall.yaml}\nlaw: trajectory_filtered\n", "utf-8")
    load_scenario(file, {"route.goal_m": [2.05, 0.75]})  # in the notch
    with pytest.raises(InputError, match=r"^route.goal_m: \(2.15, 0.75\) is in an occ"):
        load_scenario(file, {"route.goal_m": [2.15, 0.75]})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"map.file": "none.yaml"}, r"^map.file: .*none.yaml' is not a file; give"),
        ({"map": {"known": True}}, r"^map.file: .*"),
        ({"obstacles": [{"name": "map"}]}, r"name 'map' is taken"),
    ],
)
def test_faults_of_the_map_name_its_field(scenario_file, fields, message):
    with pytest.raises(InputError, match=message):
        load_scenario(scenario_file, fields)


def test_a_route_leads_around_the_wall_of_a_map(scenario_file):
    """Half of it: a tangent to the disc around the corner (2, 2), an arc, and 0.1 m."""
    radius, known = 0.3, load_scenario(scenario_file).mapped()
    away = math.hypot(1.9, 2.0)
    heading = math.atan2(2.0, 1.9) + math.asin(radius / away)
    half = math.sqrt(away**2 - radius**2) + radius * heading + 0.1
    route = plan_route((0.1, 0.0), (4.1, 0.0), known, clearance_m=radius)
    assert route.length_m == pytest.approx(2.0 * half, rel=0.02)
