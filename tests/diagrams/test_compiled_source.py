"""Values get into generated source whole, and compiled code is kept as what it is."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from diagrams.compiled import source as compiled_source
from diagrams.compiled.source import PACKED, Packing, compiled_from
from systems.laws.impedance import AttractionParameters


class Numbers(NamedTuple):
    attraction: AttractionParameters
    function: Any
    rest: tuple[Any, ...]


def doubled(x):
    return 2.0 * x


SOURCE = f"def loop({PACKED}):\n    return doubled(floats[0])\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_source, "cache_folder", lambda: tmp_path)
    compiled_source._loaded.cache_clear()
    yield tmp_path / "phonotaxis_loops"
    compiled_source._loaded.cache_clear()


def test_values_come_back_from_their_expression():
    packing, array = Packing(), np.arange(6.0).reshape(2, 3)
    vector = np.array([1.5, 2.5])
    value = Numbers(
        AttractionParameters(stiffness_n_m=3.5),
        doubled,
        (7, True, None, "text", [], [(1.0, 2.0)], array, vector, np.uint64(2**63)),
    )
    text = packing.expression(value)
    names = {
        **packing.names,
        **dict(zip(PACKED.split(", "), packing.values, strict=True)),
    }
    found = eval(text, names)
    assert type(found) is Numbers
    assert found.attraction.stiffness_n_m == 3.5
    assert found.function(4.0) == 8.0
    whole, flag, unset, word, empty, pairs, same, floats, large = found.rest
    assert (whole, flag, unset, word) == (7, True, 0.0, "text")
    assert type(whole) is np.int64
    assert empty.shape == (0, 2)
    assert pairs.tolist() == [[1.0, 2.0]]
    assert same is array
    assert floats.tolist() == vector.tolist()
    assert large == 2**63


def test_vectors_share_memory_where_they_are_one():
    """A port that one block writes is the one that another reads."""
    packing, port = Packing(), np.zeros(2)
    assert packing.expression(port) == packing.expression(port)
    assert packing.expression(port) != packing.expression(np.zeros(2))


def test_compiled_code_is_kept(folder):
    packing = Packing()
    packing.expression(3.0)
    name = packing.name(doubled)
    source = SOURCE.replace("doubled", name)
    function = compiled_from(source, packing.names)
    assert function(*packing.values) == 6.0
    assert compiled_from(source, packing.names) is function
    (file,) = folder.glob("*.source")
    assert source in file.read_text()
    assert list((folder / "__pycache__").glob(f"{file.stem}*.nbc"))
    compiled_source._loaded.cache_clear()
    again = compiled_from(source, packing.names)
    assert again(*packing.values) == 6.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_what_a_closure_holds_is_never_taken_from_the_disk(folder):
    def adding(term):
        return lambda x: x + term

    for term in (1.0, 2.0):
        packing = Packing()
        added = packing.expression(adding(term))
        source = f"def loop({PACKED}):\n    return {added}(1.0)\n"
        assert compiled_from(source, packing.names)(*packing.values) == 1.0 + term
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
        compiled_from(SOURCE, {"doubled": module.own})
        names.append({path.name for path in folder.glob("*.source")})
    assert len(names[1] - names[0]) == 1


def test_files_that_nobody_uses_are_removed(folder):
    packing = Packing()
    packing.expression(3.0)
    source = SOURCE.replace("doubled", packing.name(doubled))
    (folder / "__pycache__").mkdir(parents=True)
    old, code = (
        folder / "loop_old.source",
        folder / "__pycache__" / "loop_old.loop-1.nbi",
    )
    for file in (old, code):
        file.write_text("")
    os.utime(old, (time.time() - 40 * 86_400.0,) * 2)
    compiled_from(source, packing.names)
    assert not old.exists()
    assert not code.exists()


def test_without_a_folder_nothing_is_kept(folder, monkeypatch):
    def refuse(*arguments, **options):
        raise OSError("no space left")

    monkeypatch.setattr(Path, "mkdir", refuse)
    packing = Packing()
    packing.expression(3.0)
    source = SOURCE.replace("doubled", packing.name(doubled))
    assert compiled_from(source, packing.names)(*packing.values) == 6.0
