"""Names of files that are made of a user's names."""

from __future__ import annotations

import pytest

from analysis.report.file_names import distinct_names


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        ("two_static_obstacles", "two_static_obstacles"),
        ("my scene, 2nd (b)", "my scene, 2nd (b)"),
        ("d\u00e9j\u00e0", "d\u00e9j\u00e0"),
        ("..", "unnamed"),
        ("", "unnamed"),
        (".hidden. ", "hidden"),
        ('a/b\\c:d*e?f"g<h>i|j\nk\x00', "a-b-c-d-e-f-g-h-i-j-k-"),
        ("\udcff", "-udcff"),
        ("\u00e9" * 300, "\u00e9" * 100),
        ("x" * 300, "x" * 200),
    ],
)
def test_a_name_stays_where_it_can(wanted, name):
    assert distinct_names([wanted]) == [name]


def test_names_that_would_be_one_get_numbers():
    wanted = ["a", "A", "a", "a-2", "e\u0301", "\u00e9"]
    names = ["a", "A-2", "a-3", "a-2-2", "e\u0301", "\u00e9-2"]
    assert distinct_names(wanted) == names


def test_names_of_other_files_are_left_alone():
    names = distinct_names(
        ["rates", "summary.json", "b", "b.png"],
        taken=("rates.png", "summary.json"),
        endings=("", ".png"),
        joint="_",
    )
    assert names == ["rates_2", "summary.json_2", "b", "b.png_2"]
