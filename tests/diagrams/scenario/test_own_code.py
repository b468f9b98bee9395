"""A user's file that has changed is loaded anew, and nothing old is used again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from analysis.loops.ideal_loop import ideal_loop
from analysis.loops.radial_law import radial_law
from diagrams import Scenario, load_scenario
from diagrams.running.compiled.loop_blocks import shared_blocks
from diagrams.scenario.own_code import import_own, own_files
from diagrams.scenario.own_versions import code_of_sweep, loaded_digests
from systems.framework.input_error import InputError

LAW = """
from own_gains import GAIN


def soft(c, s, laws):
    return GAIN / (1.0 + c)
"""
NAMES = "own_laws.py:soft", "own_laws:soft"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with modules of a user's that no other test has."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    for name in ("own_laws", "own_gains", "own_counter"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    Path("own_laws.py").write_text(LAW)
    return tmp_path


def with_gain(gain: float) -> None:
    """Of one size, and written within one second: bytecode cannot tell them apart."""
    Path("own_gains.py").write_text(f"GAIN = {gain:.1f}\n")


def scenario(name: str) -> Scenario:
    return load_scenario(
        "default",
        [
            f"law={name}",
            "hearing=ideal_always",
            "obstacle_sensing=ideal",
            "plant.pulses_per_revolution=null",
        ],
    )


@pytest.mark.parametrize("name", NAMES)
def test_another_text_of_a_file_beside_it_is_another_law(name):
    for gain in (2.0, 3.0, 9.0, 2.0):
        with_gain(gain)
        law = import_own(name, "law")
        assert law(0.0, 0.0, None) == gain
        assert import_own(name, "law") is law, "the same text is the same function"


@pytest.mark.parametrize("name", NAMES)
def test_another_text_of_the_file_itself_is_another_law(name):
    with_gain(2.0)
    for factor in (1.0, 4.0, 5.0):
        Path("own_laws.py").write_text(LAW.replace("GAIN /", f"{factor} * GAIN /"))
        assert import_own(name, "law")(0.0, 0.0, None) == 2.0 * factor


def test_a_module_that_two_files_use_is_new_to_both(folder):
    (folder / "own_others.py").write_text(LAW)
    for gain in (2.0, 3.0):
        with_gain(gain)
        for name in (NAMES[0], "own_others.py:soft", NAMES[0]):
            assert import_own(name, "law")(0.0, 0.0, None) == gain


def test_a_module_that_uses_nothing_of_a_changed_one_keeps_its_state(folder):
    (folder / "own_counter.py").write_text("calls = []\n\ndef law(c, s, _): ...\n")
    with_gain(2.0)
    law = import_own("own_counter:law", "law")
    sys.modules["own_counter"].calls.append(1)
    import_own(NAMES[1], "law")
    with_gain(3.0)
    assert import_own(NAMES[1], "law")(0.0, 0.0, None) == 3.0
    assert import_own("own_counter:law", "law") is law
    assert sys.modules["own_counter"].calls == [1]


def test_whence_a_number_comes_is_known(folder):
    with_gain(2.0)
    files = (folder / "own_gains.py", folder / "own_laws.py")
    assert own_files(NAMES[0], "law") == files
    assert [*loaded_digests(scenario(NAMES[0]))] == [str(files[1]), str(files[0])]


def test_builds_that_are_kept_are_of_the_present_law():
    """Compiled blocks, the loop of linear models, and the table of the law's energy."""
    found: list[list[Any]] = []
    for gain in (2.0, 3.0):
        with_gain(gain)
        run = scenario(NAMES[0])
        kept: list[Any] = [
            shared_blocks(run)["robot"],
            ideal_loop(run),
            radial_law(run),
        ]
        again = [shared_blocks(run)["robot"], ideal_loop(run), radial_law(run)]
        for one, other in zip(kept, again, strict=True):
            assert one is other
        controller = kept[0].blocks["controller"]
        assert controller.radial_force(1.0, 0.0) == 0.5 * gain
        assert radial_law(run).function(1.0, 0.0) == 0.5 * gain
        found.append(kept)
    for one, other in zip(*found, strict=True):
        assert one is not other


def test_a_sweep_goes_on_with_what_it_began_with_or_not_at_all():
    with_gain(2.0)
    run = scenario(NAMES[0])
    wanted = loaded_digests(run)
    with_gain(3.0)
    with code_of_sweep(run, wanted):
        assert import_own(NAMES[0], "law")(0.0, 0.0, None) == 2.0
    assert import_own(NAMES[0], "law")(0.0, 0.0, None) == 3.0
    with (
        pytest.raises(InputError, match=r"own_gains\.py has changed since the sweep"),
        code_of_sweep(run, wanted),
    ):
        pass
