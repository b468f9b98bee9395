"""``python -m studies``: the list, and what each study offers."""

from __future__ import annotations

import argparse
from importlib import import_module

import pytest

from studies.__main__ import main, studies
from studies.support.figures import Figure, bounds_table
from studies.tables import MissedBoundError


def test_list_has_a_line_for_each_study(capsys):
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [*studies()]
    assert all(line.split(maxsplit=1)[1] for line in lines)


@pytest.mark.parametrize("name", studies())
def test_each_study_tells_its_options(name, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, "--help"])
    assert ended.value.code == 0
    assert "--out" in capsys.readouterr().out
    study = import_module(f"studies.{name}")
    study.add_options(argparse.ArgumentParser())
    assert callable(study.run)


def test_unknown_study_is_status_2(capsys):
    assert main(["nosuch"]) == 2
    assert "nosuch" in capsys.readouterr().err


def test_a_missed_bound_is_told_after_the_table():
    tables = bounds_table(
        [Figure("good", 2.0, ">=", 1.0), Figure("bad", 2.0, "<=", 1.0)]
    )
    assert [row[0] for row in next(tables).rows] == ["good", "bad"]
    with pytest.raises(MissedBoundError, match=r"^bad$"):
        next(tables)
