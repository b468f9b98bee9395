"""docs/extending.md is true: a sensor and a block are a file each."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from diagrams import RunResult, build_sound_follower, load_scenario, simulate
from diagrams.scenario.own_code import own_files
from docs.building.page_code import page_file
from systems.framework.input_error import InputError

pytestmark = pytest.mark.drake

#: A source that is nearer than the follow distance, and a box behind the robot.
PUSHED_BACK = [
    "hearing=ideal",
    "law=none",
    "attraction={stiffness_n_m: 4, damping_n_s_m: 8}",
    "source.waypoints_m=[[0.8, 0.0]]",
    "obstacles=[{name: box, size_m: [0.2, 2.0], waypoints_m: [[-0.775, 0.0]]}]",
    "duration_s=6",
]


ASKS_FOR_WHEELS = """
class Mine(Block):
    part = "mine"
    def __init__(self, wheels): super().__init__()
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The page's files, in the working directory."""
    for name in ("rear_sonar.py", "careful_command.py"):
        (tmp_path / name).write_text(page_file("extending.md", name), "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*blocks: str, engine: Literal["drake", "compiled"] = "drake") -> RunResult:
    settings = [*PUSHED_BACK, f"blocks=[{', '.join(blocks)}]"]
    return simulate(load_scenario("default", settings), engine=engine)


def test_the_pages_sensor_is_logged_and_changes_nothing(folder):
    """The box is 0.5 m behind the back: from -0.175 m to -0.675 m."""
    without, with_sonar = run(), run("rear_sonar.py:RearSonar")
    assert folder
    assert with_sonar.columns["rear_range"][0] == pytest.approx(0.5)
    assert without.cause == with_sonar.cause == "collision"
    assert set(with_sonar.columns) - set(without.columns) == {"rear_range"}
    assert (with_sonar.columns["p_WB_x"] == without.columns["p_WB_x"]).all()


def test_the_pages_block_stands_in_the_place_of_ours(folder):
    result = run("rear_sonar.py:RearSonar", "careful_command.py:CarefulCommand")
    assert folder
    assert result.collision is None
    assert result.columns["rear_range"].min() == pytest.approx(0.2, abs=0.05)
    follower = build_sound_follower(result.full_scenario)
    assert follower.blocks["command"].get_name() == "careful_command"
    assert not follower.robots["robot"].diagram.HasSubsystemNamed("wheel_command")


def test_the_pages_sensor_measures_every_second_tick(folder):
    """The robot moves back, so each measured range is new."""
    assert folder
    ranges = run("rear_sonar.py:RearSonar").columns["rear_range"][20:60]
    assert (ranges[1::2] == ranges[::2]).all()
    assert (ranges[2::2] != ranges[:-2:2]).all()


@pytest.mark.slow
def test_the_pages_blocks_run_in_both_engines(folder):
    assert folder
    blocks = "rear_sonar.py:RearSonar", "careful_command.py:CarefulCommand"
    drake, compiled = run(*blocks), run(*blocks, engine="compiled")
    assert compiled.engine == "compiled"
    for column in ("rear_range", "wheel_speed_left", "p_WB_x"):
        np.testing.assert_allclose(
            compiled.columns[column], drake.columns[column], atol=1e-9
        )


def test_a_sweep_knows_the_files_of_blocks(folder):
    assert own_files("rear_sonar.py:RearSonar", "blocks") == (folder / "rear_sonar.py",)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("Mine = 3", r"has no function or class 'Mine'"),
        ("def Mine(): pass", r"is not a Block; derive"),
        ("class Mine(Block): pass", r"does not state its part; give the class .* part"),
        (
            ASKS_FOR_WHEELS,
            r"cannot be made \(TypeError: .*'wheels'.*\); it may take scenario, ro",
        ),
        ("1 / 0", r"cannot be imported: ZeroDivisionError"),
    ],
)
def test_bad_blocks(tmp_path, code, message):
    path = tmp_path / "mine.py"
    path.write_text(f"from systems import Block\n{code}\n")
    scenario = load_scenario("default", [f"blocks=['{path}:Mine']"])
    with pytest.raises(InputError, match=rf"^blocks: .*{message}"):
        build_sound_follower(scenario)


def test_two_blocks_of_one_part(folder):
    assert folder
    name = "rear_sonar.py:RearSonar"
    with pytest.raises(InputError, match=r"^blocks: .* is a second 'rear_sonar'"):
        run(name, name)


def test_a_quantity_that_nobody_publishes(folder):
    assert folder
    with pytest.raises(InputError, match=r"^careful_command: 0 blocks .*'rear_range'"):
        run("careful_command.py:CarefulCommand")
