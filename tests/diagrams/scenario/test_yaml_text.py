"""YAML from anywhere is read within limits."""

from __future__ import annotations

import pytest

from diagrams.scenario.yaml_text import DEEPEST, LARGEST_BYTES, parse_yaml
from systems.framework.input_error import InputError

#: 9^10 x in 330 bytes.
BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "\n".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)
)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a: [1, 2.5, x]", {"a": [1, 2.5, "x"]}),
        ("a: &one [1]\nb: *one", {"a": [1], "b": [1]}),
        (b"\xef\xbb\xbfa: \xc3\xa9", {"a": "\u00e9"}),
        ("[" * DEEPEST + "]" * DEEPEST, eval("[" * DEEPEST + "]" * DEEPEST)),
        ("", None),
    ],
)
def test_plain_values(text, value):
    assert parse_yaml(text, "here") == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "aliases .* stand for more than 1,000,000"),
        ("&a [*a]", r"\*a contains itself"),
        ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), "more than 20 deep"),
        ("[" * 90_000, "more than 20 deep"),
        ("x" * (LARGEST_BYTES + 1), "more than 300 kB"),
        ("a: [1", "line 1, column 6"),
        ("a: 1\na: 2", "line 2, column 1: found duplicate key"),
        ("!!int x", "ValueError"),
        ("!!bool x", "KeyError"),
        ("2024-13-45", "month"),
        ("9" * 5000, "4300 digits"),
        ("!!python/object:os.system x", "could not determine a constructor"),
        ("\udcff", "ReaderError"),
        (b"\xff\xfe\x00", "ReaderError"),
    ],
)
def test_what_nobody_means_is_one_line(text, message):
    with pytest.raises(InputError, match=message) as error:
        parse_yaml(text, "here")
    assert error.value.field == "here"
    assert len(str(error.value)) <= 280
    assert "\n" not in str(error.value)
