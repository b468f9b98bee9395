"""Data objects as JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from analysis.report.plain_values import plain, write_json
from systems.base.robot import RobotParameters


@dataclass(frozen=True)
class Inner:
    pole: complex
    margin: float


@dataclass(frozen=True)
class Outer:
    name: str
    inner: tuple[Inner, ...]
    matrix: np.ndarray
    flag: bool
    nothing: None = None
    _hidden: object = field(default_factory=object)


def test_everything_becomes_json() -> None:
    data = Outer(
        "loop",
        (Inner(1.0 - 2.0j, np.inf), Inner(np.complex128(3.0), np.float64(0.5))),
        np.array([[1.0, np.nan], [3.0, 4.0]]),
        flag=True,
    )
    document = json.loads(json.dumps(plain(data), allow_nan=False))
    assert document == {
        "name": "loop",
        "inner": [
            {"pole": [1.0, -2.0], "margin": None},
            {"pole": [3.0, 0.0], "margin": 0.5},
        ],
        "matrix": [[1.0, None], [3.0, 4.0]],
        "flag": True,
        "nothing": None,
    }


def test_arrays_of_complex_numbers_and_mappings() -> None:
    assert plain({1: np.array([1j, 2.0])}) == {"1": [[0.0, 1.0], [2.0, 0.0]]}
    assert plain(np.int64(3)) == 3
    assert plain(Path("a") / "b") == "a/b"
    assert plain(RobotParameters())["mass_kg"] == 3.94


def test_what_has_no_plain_form_is_named() -> None:
    with pytest.raises(TypeError, match="object has no plain form"):
        plain([object()])


def test_document_ends_with_a_line_and_holds_no_nan(tmp_path):
    path = tmp_path / "summary.json"
    write_json({"runs": [1, 2.5]}, path)
    assert path.read_text("utf-8").endswith("}\n")
    assert json.loads(path.read_text("utf-8")) == {"runs": [1, 2.5]}
    with pytest.raises(ValueError, match="JSON"):
        write_json({"runs": float("nan")}, path)
