"""Compiled code has a folder, also where nothing can be written."""

from __future__ import annotations

import os
from pathlib import Path

import numba
import pytest

from systems.framework.compiling import provide_cache


@pytest.fixture(autouse=True)
def no_cache_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr("numba.config.CACHE_DIR", "")


def test_a_folder_that_can_be_made_is_left_to_numba(tmp_path):
    assert provide_cache([Path("/dev/null/none"), tmp_path / "deep" / "cache"]) is None
    assert not os.environ["NUMBA_CACHE_DIR"]


def test_a_read_only_installation_gets_a_folder_of_its_own(tmp_path):
    """Below a device nothing can be made even by root."""
    made = provide_cache([Path("/dev/null/none"), Path("/dev/null/other")])
    assert made is not None
    assert made.is_dir()
    assert os.environ["NUMBA_CACHE_DIR"] == str(made)
    told = vars(numba.config)["CACHE_DIR"]
    assert told == str(made), "numba was loaded before"


def test_a_folder_that_the_user_chose_stays(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert provide_cache([Path("/dev/null/none")]) is None
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path)
