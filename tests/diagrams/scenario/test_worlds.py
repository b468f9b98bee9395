"""Worlds: what their files contain, and what a scenario takes from them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label

import phonotaxis
from analysis.batches.comparison_plans import comparison_plan
from diagrams import dump_scenario, load_scenario
from diagrams.scenario.worlds.catalog import chosen_worlds, find_world, open_worlds
from systems.framework.input_error import InputError
from tools import worlds as made

TABLES = {
    "cylinders.csv": "world,x_m,y_m\na,1,2\na,1.5,2\nb,0,4\n",
    "paths.csv": "world,path_length_m\na,12.5\nb,11\n",
}
MODEL = """<model name='{name}'><pose>{pose}</pose><link name='l'><pose>{link}</pose>
<collision name='c'><geometry>{shape}</geometry></collision></link></model>"""
ROUND = "<cylinder><radius>0.075</radius><length>1</length></cylinder>"
LONG = "<box><size>0.4 0.1 1</size></box>"
PLANE = "<plane><normal>0 0 1</normal><size>100 100</size></plane>"


def tables(folder: Path, **changes: str) -> Path:
    for name, text in TABLES.items():
        (folder / name).write_text(changes.get(name[:-4], text), "utf-8")
    return folder


def model(shape: str, pose: str = "1 6 0 0 0 0", link: str = "0 0 0 0 0 0") -> str:
    return MODEL.format(name="m", pose=pose, link=link, shape=shape)


def gazebo(folder: Path, *models: str, number: int = 7) -> Path:
    text = f"<sdf version='1.6'><world name='w'>{''.join(models)}</world></sdf>"
    (folder / f"world_{number}.world").write_text(text, "utf-8")
    return folder


def test_our_worlds_are_those_that_the_program_makes():
    for number in (0, 4):
        rows = made.rows_of(number)
        for name, lines in zip(("cylinders.csv", "paths.csv"), rows, strict=True):
            shipped = (made.FOLDER / name).read_text("utf-8").splitlines()
            own = [line for line in shipped if line.startswith(f"{number},")]
            assert own == lines


def test_a_disc_passes_through_each_of_our_worlds():
    """On a grid of 5 cm: cylinders grown by the disc leave start and goal joined."""
    step = 0.05
    y, x = np.mgrid[0.0:14.0:step, -4.425 : -0.075 + step : step]
    for name, read in open_worlds("shipped").items():
        world = read()
        blocked = np.zeros(x.shape, dtype=bool)
        for each in world.obstacles:
            (center,) = each["waypoints_m"]
            away = np.hypot(x - center[0], y - center[1])
            blocked |= away < made.DISC_M + each["radius_m"] - step
        parts, _ = label(~blocked, structure=np.ones((3, 3)))
        ends = [
            parts[round(p[1] / step), round((p[0] + 4.425) / step)]
            for p in (world.start_m, world.goal_m)
        ]
        assert ends[0] == ends[1] != 0, name
        straight = math.dist(world.start_m, world.goal_m)
        assert world.path_length_m is not None
        assert straight < world.path_length_m < 1.5 * straight


def test_the_length_of_an_empty_corridor_is_that_of_its_cells():
    """67 cells straight up of 0.15 m, and both legs to the middles of cells."""
    cells = np.zeros((made.ROWS, made.COLUMNS), dtype=bool)
    legs = math.hypot(0.075, 0.075) + math.hypot(0.075, 0.025)
    assert made.reference_length(cells) == pytest.approx(
        66 * 0.15 + legs, abs=0.15 * math.sqrt(2.0)
    )
    cells[40] = True
    assert made.reference_length(cells) is None


def test_tables_become_obstacles_start_goal_and_path(tmp_path):
    more = "world,path_length_m,start_x_m,start_heading_deg,goal_y_m\n"
    tables(
        tmp_path,
        cylinders="world,x_m,y_m,radius_m\na,1,2,0.3\na,1.5,2,0.1\n",
        paths=f"{more}a,12.5,-1,45,9\n",
    )
    scenario = load_scenario("barn", {"world": f"{tmp_path}:a"})
    assert [o.radius_m for o in scenario.obstacles] == [0.3, 0.1]
    assert [o.waypoints_m for o in scenario.obstacles] == [((1, 2),), ((1.5, 2),)]
    start = scenario.only.start
    assert (start.position_m, start.heading_deg) == ((-1.0, 3.0), 45.0)
    assert scenario.source.waypoints_m == ((-2.25, 9.0),)
    assert scenario.source.body is False, "a point"
    assert scenario.reference_path_m == 12.5


def test_fields_beside_a_world_win_and_obstacles_are_added(tmp_path):
    tables(tmp_path)
    file = tmp_path / "mine.yaml"
    file.write_text(
        "world: '.:a'\nstart: {heading_deg: 10}\nobstacles: [{name: own}]\n", "utf-8"
    )
    scenario = load_scenario(file)
    assert [o.name for o in scenario.obstacles] == ["cylinder 1", "cylinder 2", "own"]
    assert scenario.only.start.heading_deg == 10.0
    # A world of a setting replaces, and other settings win over it in any order.
    words = ["start.heading_deg=20", f"world={tmp_path}:b"]
    for given in (words, words[::-1]):
        changed = load_scenario(file, given)
        assert [o.waypoints_m for o in changed.obstacles] == [((0.0, 4.0),)]
        assert changed.only.start.heading_deg == 20.0
    assert scenario.with_({"world": f"{tmp_path}:b"}).reference_path_m == 11.0
    # A saved scenario needs the files of the world no more.
    file.write_text(dump_scenario(changed), "utf-8")
    for name in TABLES:
        (tmp_path / name).unlink()
    assert load_scenario(file) == changed


def test_a_robot_on_a_route_gets_the_goal_of_its_route(tmp_path):
    tables(tmp_path)
    routed = load_scenario("unknown_block", {"world": f"{tmp_path}:b"})
    assert routed.router.route.goal_m == (-2.25, 13.0)


def test_a_source_moves_to_the_goal_and_keeps_its_body(tmp_path):
    fields = {"world": f"{tables(tmp_path)}:b", "source": {"length_m": 0.5}}
    source = load_scenario({"hearing": "ideal", **fields}).source
    assert (source.waypoints_m, source.length_m) == (((-2.25, 13.0),), 0.5)
    assert source.body


def test_gazebo_poses_are_nested_and_planes_are_no_obstacles(tmp_path):
    """A link 1 m ahead of a model that is turned by 90 deg is 1 m to its left."""
    gazebo(
        tmp_path,
        model(PLANE),
        model(ROUND, "-0.075 0.075 0 0 0 0"),
        model(LONG, "2 3 0 0 0 1.5707963267948966", "1 0 0 0 0 0.5"),
    )
    cells = np.array([[15.0, 0.0], [15.0, 40.0], [18.0, 44.0]])
    (tmp_path / "path_files").mkdir()
    np.save(tmp_path / "path_files" / "path_7.npy", cells)
    disc, box = find_world(f"{tmp_path}:7", Path()).obstacles
    assert (disc["radius_m"], disc["waypoints_m"]) == (0.075, [[-0.075, 0.075]])
    assert box["size_m"] == [0.4, 0.1]
    np.testing.assert_allclose(box["waypoints_m"], [[2.0, 4.0]], atol=1e-12)
    assert box["heading_deg"] == pytest.approx(90.0 + math.degrees(0.5))
    # x = 0.15 i - 0.075 - 30*0.15 and y = 0.15 j + 5.075: i = 15 is x = -2.325.
    legs = math.hypot(0.075, 2.075) + math.hypot(-2.25 + 1.875, 13.0 - 11.675)
    path = find_world(f"{tmp_path}:7", Path()).path_length_m
    assert path == pytest.approx(40 * 0.15 + 5 * 0.15 + legs)


@pytest.mark.parametrize(
    ("changes", "field", "hint"),
    [
        ({"cylinders": "x_m,y_m\n1,2\n"}, "cylinders.csv", "must name world,x_m,y_m"),
        ({"cylinders": "world,x_m,y_m\na,1\n"}, "cylinders.csv", "line 2: y_m is None"),
        ({"cylinders": "world,x_m,y_m\n,1,2\n"}, "cylinders.csv", "line 2 has no w"),
        ({"cylinders": "world,x_m,y_m\na,1,nan\n"}, "cylinders.csv", "give a number"),
        (
            {"cylinders": "world,x_m,y_m,radius_m\na,1,2,0\n"},
            "cylinders.csv",
            "must be positive",
        ),
        ({"paths": "world,path_length_m\na,1\n"}, "paths.csv", "no line for world b"),
        ({"paths": TABLES["paths.csv"] + "c,9\n"}, "paths.csv", "world c has no cyl"),
        ({"paths": TABLES["paths.csv"] + "a,9\n"}, "paths.csv", "listed twice"),
        ({"paths": "world,path_length_m\na,-1\nb,1\n"}, "paths.csv", "be positive"),
    ],
)
def test_a_faulty_table_is_refused_in_one_line(tmp_path, changes, field, hint):
    tables(tmp_path, **changes)
    with pytest.raises(InputError) as caught:
        open_worlds(tmp_path)
    assert field in caught.value.field
    assert hint in caught.value.message
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("models", "hint"),
    [
        (["<broken"], "cannot be read as SDF"),
        ([model(PLANE)], "no model with a cylinder or a box"),
        ([model("<mesh><uri>x.dae</uri></mesh>")], "only cylinders and boxes"),
        ([model(ROUND, "1 2 0 0.5 0 0")], "leans by 0.5 rad"),
        ([model(ROUND, "1 2 0")], "6 numbers are needed"),
        ([model(ROUND.replace("0.075", "-1"))], "must be positive"),
        (["<include><uri>model://table</uri></include>"], "model://table"),
        (["<model name='m'><plugin name='p'/></model>"], "plugin that moves it"),
    ],
)
def test_a_faulty_world_of_gazebo_is_refused_in_one_line(tmp_path, models, hint):
    gazebo(tmp_path, *models)
    with pytest.raises(InputError) as caught:
        open_worlds(tmp_path)["7"]()
    assert "world_7.world" in caught.value.field
    assert hint in caught.value.message


def test_a_faulty_path_is_refused(tmp_path):
    gazebo(tmp_path, model(ROUND))
    assert find_world(f"{tmp_path}:7", Path()).path_length_m is None
    np.save(tmp_path / "path_7.npy", np.zeros(3))
    with pytest.raises(InputError, match=r"shape \(3,\)"):
        open_worlds(tmp_path)["7"]()
    (tmp_path / "path_7.npy").write_text("no array", "utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        open_worlds(tmp_path)["7"]()


CONFIG = """# Test 1
<arg name="initial_pose_x" default="0.5"/>
<arg name="initial_pose_y" default="-0.5"/>
<arg name="initial_pose_a" default="-3.142"/>
<arg name="goal_pose_x" default="-0.5"/>
<arg name="goal_pose_y" default="0.25"/>
<arg name="goal_pose_a" default="0"/>
"""


def a_map(folder: Path, config: str = CONFIG) -> Path:
    """A map of 40 x 40 cells of 10 cm around the origin, with one occupied cell."""
    place = folder / "maze"
    place.mkdir()
    pixels = np.full((40, 40), 254, dtype=np.uint8)
    pixels[0, 0] = 0  # the upper left corner
    (place / "map.pgm").write_bytes(b"P5 40 40 255\n" + pixels.tobytes())
    header = "image: map.pgm\nresolution: 0.1\norigin: [-2, -2, 0]\nnegate: 0\n"
    header += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    (place / "map.yaml").write_text(header, "utf-8")
    (place / "config.txt").write_text(config, "utf-8")
    return folder


def test_tests_of_a_map_are_worlds(tmp_path):
    a_map(tmp_path)
    for source in (tmp_path, tmp_path / "maze"):
        assert chosen_worlds(source) == [f"{source}:maze_1"]
    scenario = load_scenario("barn", {"world": f"{tmp_path}:maze_1"})
    assert scenario.map is not None
    assert scenario.map.file == str(tmp_path / "maze" / "map.yaml")
    assert scenario.only.start.position_m == (0.5, -0.5)
    heading = scenario.only.start.heading_deg
    assert math.cos(math.radians(heading)) == pytest.approx(-1.0, abs=1e-6)
    assert scenario.source.waypoints_m == ((-0.5, 0.25),)
    assert (scenario.obstacles, scenario.reference_path_m) == ((), None)
    assert scenario.with_({"world": "0"}).map is None


@pytest.mark.parametrize(
    ("config", "hint"),
    [
        ("", "has no tests"),
        (CONFIG.replace("# Test 1", ""), "line 2 precedes all tests"),
        (CONFIG.replace("0.25", "far"), "goal_pose_y is 'far'"),
        (CONFIG.replace("goal_pose_x", "goal_x"), "test 1 has no goal_pose_x"),
    ],
)
def test_a_faulty_test_of_a_map_is_refused(tmp_path, config, hint):
    with pytest.raises(InputError, match=hint):
        open_worlds(a_map(tmp_path, config))


def test_worlds_are_chosen_by_number_or_by_name(tmp_path):
    paths = "".join(f"{k},9\n" for k in (0, 2, 3, 6, 12))
    cylinders = "".join(f"{k},1,1\n" for k in (0, 2, 3, 6, 12))
    tables(
        tmp_path,
        cylinders=f"world,x_m,y_m\n{cylinders}",
        paths=f"world,path_length_m\n{paths}",
    )
    names = [f"{tmp_path}:{k}" for k in (0, 6, 12)]
    assert chosen_worlds(tmp_path, every=6) == names
    assert chosen_worlds(tmp_path, every=6, names=["3", "6"]) == names[1:2]
    for every, only, field in (
        (6, ["3"], "every"),
        (0, [], "every"),
        (1, "4", "names"),
    ):
        with pytest.raises(InputError) as caught:
            chosen_worlds(tmp_path, every, only)
        assert caught.value.field == field


def test_every_law_meets_every_world_in_turn(tmp_path):
    tables(tmp_path)
    worlds = chosen_worlds(tmp_path)
    plan = comparison_plan("barn", laws="none,dwa", runs=2, worlds=worlds)
    points = plan.points()
    assert [point.fields["world"] for point in points[::2]] == [*worlds, *worlds]
    assert [point.fields["law"] for point in points[:2]] == ["none", "dwa"]
    seeds = [point.seed for point in points]
    assert seeds[::2] == seeds[1::2]
    assert len(set(seeds)) == 4
    found = plan.scenario_of(points[2])
    assert [o.waypoints_m for o in found.obstacles] == [((0.0, 4.0),)]
    assert found.reference_path_m == 11.0
    # A sweep continues only in the worlds that it began with.
    before = plan.digest
    tables(tmp_path, cylinders=TABLES["cylinders.csv"].replace("1.5", "1.6"))
    again = comparison_plan("barn", laws="none,dwa", runs=2, worlds=worlds)
    assert again.digest != before


def test_the_list_of_worlds(capsys, tmp_path):
    tables(tmp_path)
    assert phonotaxis.main(["worlds", str(tmp_path)]) == 0
    assert "b  1 obstacles, from (-2.25, 3) to (-2.25, 13) m, path 11.00 m" in (
        capsys.readouterr().out
    )
    found = phonotaxis.worlds()
    assert len(found) == found.document()["count"] == made.WORLDS


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["worlds", "nowhere"], "worlds: nowhere is no folder with cylinders.csv"),
        (["compare", "--every", "6"], "every: selects worlds; write --worlds PATH"),
        (["compare", "--worlds", "--names", "99"], "names: shipped has no world '99'"),
        (["compare", "--worlds", "--runs", "0"], "runs: "),
        (["simulate", "barn", "--set", "world=99"], "world: 99 is not known; phono"),
    ],
)
def test_bad_words_are_one_line(capsys, words, message):
    assert phonotaxis.main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
