"""Values get into generated source whole, and compiled code is kept as what it is."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from diagrams.running.compiled import source as compiled_source
from diagrams.running.compiled.parts import run_parts
from diagrams.running.compiled.source import LoopPart, address_of, compiled_part
from systems.framework.input_error import InputError
from systems.laws.parameters import AttractionParameters


class Numbers(NamedTuple):
    attraction: AttractionParameters
    function: Any
    rest: tuple[Any, ...]


def doubled(x):
    return 2.0 * x


def compiled(part, *lines):
    return compiled_part(part.source(lines), part.names)


def called(part, *lines, tick=0):
    return compiled(part, *lines)(tick, part.words().ctypes.data)


def made(function=doubled):
    """A part that returns twice three, and its line."""
    part = LoopPart()
    return part, f"return int({part.name(function)}({part.expression(3.0)}))"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_source, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")  # a developer's may be set
    compiled_source._loaded.cache_clear()
    yield tmp_path / "parts"
    compiled_source._loaded.cache_clear()


def test_values_come_back_from_their_expression():
    part, array, found = LoopPart(), np.arange(6.0).reshape(2, 3), np.zeros(16)
    vector, few = np.array([1.5, 2.5]), np.array([1.5], dtype=np.float32)
    rest: Any = (
        7,
        True,
        None,
        [],
        [(1.0, 2.0)],
        array,
        vector,
        np.uint64(2**63),
        -0.0,
        few,
        "it's",
    )
    value = Numbers(AttractionParameters(stiffness_n_m=3.5), doubled, rest)
    lines = [
        f"value, found = {part.expression(value)}, {part.expression(found)}",
        "whole, flag, unset, empty, pairs, array = value.rest[:6]",
        "vector, large, low, few, text = value.rest[6:]",
        "found[0], found[1] = value.attraction.stiffness_n_m, value.function(4.0)",
        "found[2], found[3], found[4] = whole // 2, 1.0 if flag else 2.0, unset",
        "found[5], found[6] = empty.shape",
        "found[7], found[8] = pairs.shape[0], pairs[0, 1]",
        "found[9], found[10], found[11] = array[1, 2], vector[1], large / 2.0**60",
        "found[12], found[13] = len(vector), few[0]",
        "found[14], found[15] = low, len(text)",
        "array[0, 0] = 99.0",
    ]
    assert called(part, *lines) == 0
    expected = [3.5, 8.0, 3, 1, 0, 0, 2, 1, 2.0, 5.0, 2.5, 8.0, 2, 1.5, 0.0, 4]
    assert found.tolist() == expected
    assert np.signbit(found[14])
    # It works on the array itself.
    assert array[0, 0] == 99.0


@pytest.mark.parametrize("value", [b"text", np.zeros(2, dtype=complex), {1: 2}])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(InputError, match="cannot be used in compiled loops"):
        LoopPart().expression((1.0, value))


def test_arrays_stand_there_once():
    part, port = LoopPart(), np.zeros(2)
    assert part.expression(port) == part.expression(port)
    assert part.expression(port) != part.expression(np.zeros(2))


def test_parts_are_called_in_order_and_end_the_run():
    """First, the judge, before the log and after it: counted and logged."""
    counts, seen = np.zeros(3), np.array([2.0, 302.0, 302.0])

    def adding(to):
        part = LoopPart()
        line = f"{part.expression(counts)}[{to}] += 1.0 if tick >= 0 else 100.0"
        return part, compiled(part, line)

    judge = LoopPart()
    ends = f"if {judge.expression(counts)}[0] > 3.5:"
    judging = judge, compiled(judge, ends, "    return 1")
    parts = [adding(0), judging, adding(1), adding(2)]
    words = [part.words() for part, _ in parts]
    calls = np.array(
        [
            (address_of(function), each.ctypes.data)
            for (_, function), each in zip(parts, words, strict=True)
        ]
    )
    log = np.zeros((9, 3))
    logged = np.array([(counts.ctypes.data, 3)])
    before, after = (np.array([(k, 0), (k, 1)]) for k in (2, 3))
    plan = np.array([2, 3]), np.array([0]), 1, before, after
    assert run_parts(0, 2, log, logged, calls, plan) == (2, False)
    assert counts.tolist() == seen.tolist()
    assert run_parts(2, 9, log, logged, calls, plan) == (4, True)
    assert log[:5, 0].tolist() == [1.0, 2.0, 3.0, 4.0, 0.0]
    assert log[:4, 1].tolist() == [201.0, 302.0, 403.0, 504.0]
    assert log[:4, 2].tolist() == [100.0, 201.0, 302.0, 403.0]


def test_what_a_part_raises_ends_the_loop():
    part = LoopPart()
    function, words = compiled(part, "1 // (tick - 1)"), part.words()
    calls = np.array([(address_of(function), words.ctypes.data)])
    none, logged = np.empty(0, dtype=np.int64), np.empty((0, 2), dtype=np.int64)
    pairs = np.empty((0, 2), dtype=np.int64)
    plan = none, np.array([0]), 0, pairs, pairs
    with pytest.raises(ZeroDivisionError):
        run_parts(0, 3, np.zeros((3, 0)), logged, calls, plan)


def test_compiled_code_is_kept(folder):
    part, line = made()
    function = compiled(part, line)
    assert called(part, line) == 6
    assert compiled(part, line) is function
    (file,) = folder.glob("*.source")
    assert line in file.read_text()
    assert list((folder / "__pycache__").glob(f"{file.stem}*.nbc"))
    compiled_source._loaded.cache_clear()
    again = compiled(part, line)
    assert called(part, line) == 6
    assert sum(again.stats.cache_hits.values()) == 1


def test_what_a_closure_holds_is_never_taken_from_the_disk(folder):
    def adding(term):
        return lambda x: x + term

    for term in (1.0, 2.0):
        assert called(*made(adding(term))) == 3.0 + term
    assert not folder.exists()


def test_another_text_of_a_users_file_is_another_loop(folder, tmp_path, monkeypatch):
    names = []
    for factor in ("2.0", "3.0"):
        file = tmp_path / "factors.py"
        file.write_text(f"def own(x):\n    return {factor} * x\n")
        module = ModuleType("factors")
        module.__file__ = str(file)
        monkeypatch.setitem(sys.modules, "factors", module)
        exec(compile(file.read_text(), str(file), "exec"), vars(module))
        compiled(*made(module.own))
        names.append({path.name for path in folder.glob("*.source")})
    assert len(names[1] - names[0]) == 1


def test_files_that_nobody_uses_are_removed(folder):
    (folder / "__pycache__").mkdir(parents=True)
    old, code = (
        folder / "part_old.source",
        folder / "__pycache__" / "part_old.part-1.nbi",
    )
    for file in (old, code):
        file.write_text("")
    os.utime(old, (time.time() - 40 * 86_400.0,) * 2)
    compiled(*made())
    assert not old.exists()
    assert not code.exists()


def test_without_a_folder_nothing_is_kept(folder, monkeypatch):
    def refuse(*arguments, **options):
        raise OSError("no space left")

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert called(*made()) == 6
