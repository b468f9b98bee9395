"""The page of public names is that of the rooms."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import pytest

from docs.tables.api import api_page, rooms

OURS = ("systems", "diagrams", "analysis")
ROOT = Path(__file__).resolve().parents[3]


def test_page_is_what_the_rooms_export() -> None:
    """``python -m docs.tables.api > docs/api.md`` writes it anew."""
    assert (ROOT / "docs" / "api.md").read_text("utf-8") == api_page()


@pytest.mark.parametrize("room", rooms())
def test_names_are_there_and_their_own(room: str) -> None:
    package = import_module(room)
    # What stands at the top gathers what its rooms, and those below, give.
    own = room if "." in room else ("systems", "diagrams")
    for name in package.__all__:
        value = getattr(package, name)
        home = getattr(value, "__module__", None)
        if isinstance(home, str) and not home.startswith(
            ("numpy", "typing", "pydrake")
        ):
            assert home.startswith(own), name
