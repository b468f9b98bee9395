"""The numbers of README's "What to expect" are those of the runs it names.

Runs are deterministic, so that every printed digit is held; ``python -m
docs.tables.readme`` prints the tables anew.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from docs.tables.readme import (
    SCENARIOS,
    ending_row,
    following_rows,
    laws_heading,
)

pytestmark = pytest.mark.slow

README = (Path(__file__).parents[2] / "README.md").read_text("utf-8").splitlines()


def test_obstacle_free():
    assert [row for row in following_rows() if row not in README] == []


def test_every_law_has_a_column():
    assert laws_heading() in "\n".join(README)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_how_the_scenarios_end(scenario):
    assert ending_row(scenario) in README
