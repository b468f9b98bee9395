"""Laws and blocks are Python objects: their names, copies, sources and gains."""

from __future__ import annotations

import functools
import hashlib
import linecache
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import pytest

import phonotaxis
from analysis.batches.comparison_plans import comparison_plan
from analysis.batches.sweep import prepare_sweep
from analysis.loops.radial_law import radial_law
from diagrams import Scenario, load_scenario, write_scenario
from diagrams.building.laws import make_controller
from diagrams.running.compiled.source import LoopPart
from diagrams.scenario.own_code import import_own
from diagrams.scenario.own_gains import default_gains, law_arguments
from diagrams.scenario.own_objects import name_of
from diagrams.scenario.warnings.warnings_of import warnings_of
from phonotaxis import InputError, SweepPlan

SHORT: dict[str, Any] = {"duration_s": 0.2, "hearing": "ideal"}
MODULE = """
from systems import Block, Port, Step

PUSH_N = 14.0


def soft(c, s, push_n=PUSH_N, reach_m=0.5):
    return push_n * 2.0 ** (-c / reach_m)


def publish(tick, state, inputs, outputs, numbers):
    outputs[0][0] = inputs[0][0] + numbers[0]


class Biased(Block):
    part = "biased"
    inputs = (Port("pose_WB", 3, "m, m, rad"),)
    outputs = (Port("biased", 1, "m", ("biased",)),)

    def __init__(self, tick_s, bias_m=0.1):
        super().__init__()
        self.declare(Step(publish, (bias_m,), [0.0]), tick_s=tick_s)
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A module of a user's in the working directory."""
    (tmp_path / "own_objects.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.delitem(sys.modules, "own_objects", raising=False)
    return __import__("own_objects")


def cell(text: str, number: int, names: dict[str, Any]) -> dict[str, Any]:
    """Runs a cell of a notebook."""
    file = f"<cell {number}>"
    linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
    exec(compile(text, file, "exec"), names)
    return names


def notebook() -> dict[str, Any]:
    return cell(MODULE, 1, {"__name__": "__main__"})


def push(law: Any, c: float = 0.5, **gains: float) -> float:
    """Force of a law at a distance, in a built block."""
    scenario = load_scenario("default", law=law, own_gains=gains)
    return float(make_controller(scenario).radial_force(c, 0.0))


def with_push(push_n: float) -> Callable[..., float]:
    def closure(c, s):
        return push_n / c

    return closure


class Callables:
    def __call__(self, c, s, push_n=3.0):
        return push_n

    def law(self, c, s, push_n=4.0):
        return push_n


def test_objects_in_files_have_names_that_any_process_can_import(own, monkeypatch):
    assert name_of(own.soft) == "own_objects:soft"
    assert name_of(own.Biased) == "own_objects:Biased"
    loaded = import_own("own_objects.py:soft", "law")
    assert name_of(loaded) == f"{Path.cwd() / 'own_objects.py'}:soft"
    monkeypatch.setattr(sys, "path", sys.path[1:])
    assert name_of(own.soft) == f"{Path.cwd() / 'own_objects.py'}:soft"


def test_an_edited_file_is_read_again_for_an_old_object(own):
    """The object of before the edit stands for its successor, also after a reload."""
    old = own.soft
    assert push(old) == 7.0
    Path("own_objects.py").write_text(MODULE.replace("14.0", "18.0"))
    assert push(old) == 9.0
    assert push(old, push_n=2.0) == 1.0


def test_every_way_to_give_a_law(own):
    """A scenario has the same law, whatever takes it."""
    ways: list[Any] = [
        load_scenario("default", law=own.soft),
        load_scenario("default", {"law": own.soft}),
        load_scenario("default").with_(law=own.soft),
        Scenario(law=own.soft),
        load_scenario({"robots": {"a": {"law": own.soft}}, "source": {}}),
    ]
    assert {way.only.law for way in ways} == {"own_objects:soft"}


@pytest.mark.parametrize(
    ("law", "force"),
    [
        (lambda c, s: 2.0, 2.0),
        (lambda c, s, laws: laws.conventional.stiffness_n_m, 12.3),
        (with_push(3.0), 6.0),
        (with_push(4.0), 8.0),
        (Callables(), 3.0),
        (Callables().law, 4.0),
        (functools.partial(Callables().law, push_n=5.0), 5.0),
    ],
)
def test_objects_of_this_process_are_laws(law, force):
    assert push(law) == pytest.approx(force)
    assert name_of(law) == name_of(law)


def test_cells_of_a_notebook_run():
    """Its function, its block, and the functions and numbers that they use."""
    text = "GAIN = 6.0\ndef half(c): return GAIN / 2.0\ndef soft(c, s, k=0.0): return "
    names = cell(f"{text}half(c) + k\n", 2, notebook())
    run = phonotaxis.simulate(
        "default",
        {**SHORT, "own_gains": {"k": 1.0, "bias_m": 0.5}},
        law=names["soft"],
        blocks=[names["Biased"]],
    )
    assert run.columns["biased"][0] == 0.5
    controller = make_controller(run.scenario)
    assert float(controller.radial_force(0.5, 0.0)) == 4.0
    # The same function in compiled code, without the time to compile a whole loop.
    part = LoopPart()
    law = part.names[part.name(controller.step.numbers.force)]
    assert numba.njit(lambda c: law(c, 0.0, 1.0))(0.5) == 4.0


def test_an_object_that_is_no_function_is_not_compiled():
    controller = make_controller(load_scenario("default", law=Callables()))
    with pytest.raises(InputError, match=r"engine: .* run with engine drake"):
        LoopPart().name(controller.step.numbers.force)


def test_an_edited_cell_or_number_is_another_law():
    """Earlier scenarios keep the law that they had."""
    names = cell("GAIN = 2.0\ndef soft(c, s): return GAIN\n", 3, {"__name__": "n"})
    before = load_scenario("default", law=names["soft"], hearing="ideal_always")
    assert radial_law(before).force(0.5) == 2.0
    names["GAIN"] = 3.0
    assert push(names["soft"]) == 3.0
    cell("def soft(c, s): return 2.0 * GAIN\n", 4, names)
    assert push(names["soft"]) == 6.0
    assert float(make_controller(before).radial_force(0.5, 0.0)) == 2.0


@pytest.mark.parametrize(
    ("law", "gains", "arguments"),
    [
        (lambda c, s: c, {}, ()),
        (lambda c, s, laws: c, {}, ("laws",)),
        (lambda c, s, laws=None: c, {}, ("laws",)),
        (lambda c, s, *rest: c, {}, ("laws",)),
        (lambda c, s, k=2.0, n=3, yes=True: c, {"k": 2.0, "n": 3}, (5.0, 4, True)),
        (lambda c, s, laws, *, k=2.0, **_: c, {"k": 2.0}, ("laws", 5.0)),
        (min, {}, ("laws",)),
    ],
)
def test_gains_are_arguments_with_numbers(law, gains, arguments):
    assert default_gains(law) == gains
    assert law_arguments(law, "laws", {"k": 5.0, "n": 4.0}) == arguments


def test_gains_are_fields(own):
    assert push(own.soft, push_n=2.0) == 1.0
    assert push(own.soft, c=1.0, reach_m=1.0) == 7.0
    scenario = load_scenario("default", law=own.soft, hearing="ideal_always")
    tables = [radial_law(scenario.with_({"own_gains.push_n": x})) for x in (2.0, 4.0)]
    assert [table.force(0.5) for table in tables] == [1.0, 2.0]
    again = load_scenario(scenario.with_({"own_gains.push_n": 2}).model_dump())
    assert again.follower.own_gains == {"push_n": 2.0}
    # Without own code, like gains of another law, they have no effect.
    (warning,) = warnings_of(load_scenario("default", {"own_gains.push_n": 2.0}))
    assert "no effect, because the law 'active'" in str(warning)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"own_gains.pushn": 2.0},
            r"own_gains\.pushn: .*own_objects:soft.* \(did .*'push_n'\?\); use push_n",
        ),
        ({"own_gains.push_n": "a"}, r"own_gains\.push_n: is 'a'; .* valid number"),
        ({"laws.soft.push_n": 2.0}, r"laws\.soft: .* write gains .* as own_gains"),
        ({"own_gain.push_n": 2.0}, r"own_gain: .*did you mean 'own_gains'"),
        ({"blocks": [object()]}, r"blocks: .* not a plain value; .* function or class"),
    ],
)
def test_wrong_gains(own, settings, message):
    with pytest.raises(InputError, match=message):
        phonotaxis.simulate("default", {**SHORT, **settings}, law=own.soft)


def test_a_law_without_gains_says_how_to_get_one():
    with pytest.raises(InputError, match=r"has no gains; .* as default, k=1\.0"):
        push(lambda c, s: c, k=2.0)


def test_sources_are_in_the_result(own, tmp_path):
    """Copies of the files as they were loaded, and what a notebook's functions use."""
    text = "GAIN = 6.0\ndef half(c): return GAIN\ndef soft(c, s): return half(c)\n"
    names = cell(text, 5, notebook())
    found: dict[str, str] = {}
    for number, law in enumerate((own.soft, names["soft"])):
        scenario = load_scenario("default", law=law, blocks=[names["Biased"]])
        make_controller(scenario)
        Path("own_objects.py").write_text(MODULE.replace("14.0", "18.0"))
        folder = tmp_path / str(number)
        folder.mkdir()
        write_scenario(scenario, folder)
        for line in (folder / "own_code" / "SHA256SUMS").read_text().splitlines():
            digest, name = line.split("  ")
            source = (folder / "own_code" / name).read_bytes()
            assert hashlib.sha256(source).hexdigest() == digest
            found[name] = source.decode()
    assert found.pop("own_objects.py") == MODULE
    law, block = sorted(found.values(), key=len)
    assert law.split("\n")[:2] == ["# GAIN = 6.0", "def half(c): return GAIN"]
    assert law.endswith("def soft(c, s): return half(c)\n")
    assert "def publish(" in block
    assert 'part = "biased"' in block


def test_an_object_of_another_process_is_named():
    with pytest.raises(InputError, match=r"'my_laws\.py:soft'"):
        phonotaxis.simulate("default", law="memory_0123456789ab:soft")


def test_objects_of_this_process_are_refused_in_sweeps():
    """Before anything runs, with the line to give."""
    refused = r"'closure' is an object of .*give 'my_laws\.py:closure'"
    for start in (
        lambda law: phonotaxis.compare("default", laws=[law, "active"]),
        lambda law: SweepPlan(set={"law": law}),
        lambda law: SweepPlan(grid={"law": [law]}),
        lambda law: SweepPlan(draw={"law": {"choice": ["active", law]}}),
        lambda law: SweepPlan(grid={"blocks": [[law]]}),
    ):
        with pytest.raises(InputError, match=refused):
            start(with_push(2.0))


def test_objects_in_files_are_names_in_sweeps(own, tmp_path):
    """Which worker processes can import; the sweep's directory has their source."""
    plan = comparison_plan(
        "default",
        laws=[own.soft, "none"],
        runs=1,
        settings={"hearing": "ideal", "own_gains.reach_m": 0.3},
        grid={"own_gains.push_n": [2.0, 14.0]},
    )
    assert plan.grid["law"] == ("own_objects:soft", "none")
    sweep = prepare_sweep(plan, tmp_path / "out")
    sweep.store.close()
    assert sweep.plan.scenario_of(sweep.points[1]).follower.own_gains == {
        "push_n": 14.0,
        "reach_m": 0.3,
    }
    assert (tmp_path / "out/own_code/own_objects.py").read_text() == MODULE
    wrong = comparison_plan("default", laws=[own.soft], grid={"own_gains.k": [2.0]})
    with pytest.raises(InputError, match=r"own_gains\.k: is not a gain"):
        prepare_sweep(wrong, tmp_path / "wrong")
    assert not (tmp_path / "wrong").exists()


def test_the_prompt_lists_gains(own, capsys):
    assert own
    for law in ("own_objects:soft", "own_objects.py:soft"):
        phonotaxis.main(["fields", "own_gains", "--law", law])
        lines = capsys.readouterr().out.splitlines()
        assert lines[0] == "own_gains.push_n = 14.0  (number)"
        assert lines[2] == "own_gains.reach_m = 0.5  (number)"
