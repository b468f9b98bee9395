"""Lists of what the package contains: its scenarios, its laws, and its worlds."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from diagrams.scenario.worlds.world import World

__all__ = ["Listing", "laws", "scenarios", "worlds"]


class Listing(Mapping[str, str]):
    """Names, each with one line of text; a table at the prompt and in notebooks."""

    def __init__(self, rows: Mapping[str, str]) -> None:
        self._rows = dict(rows)

    def __getitem__(self, name: str) -> str:
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        width = max(map(len, self._rows), default=0)
        return "\n".join(f"{name:<{width}}  {line}" for name, line in self.items())

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td><code>{html.escape(name)}</code></td>"
            f'<td style="text-align: left">{html.escape(line)}</td></tr>'
            for name, line in self.items()
        )
        return f"<table>{rows}</table>"


def scenarios() -> Listing:
    """Lists the scenarios of the library, by name, with a description of each."""
    from diagrams.scenario.loading import library_scenarios, read_mapping

    return Listing(
        {
            name: read_mapping(path).get("description", "")
            for name, path in library_scenarios().items()
        }
    )


def laws() -> Listing:
    """Lists the laws that can be named, with the title of each."""
    from diagrams.scenario.fields.shipped import known_laws

    return Listing(known_laws())


class Worlds(Listing):
    """Worlds of a set by name, each with its obstacles, start, goal and path."""

    def __init__(self, source: str, found: Mapping[str, World]) -> None:
        super().__init__({name: _about(each) for name, each in found.items()})
        self.source = source
        """``shipped``, or the folder of the worlds."""
        self._found = dict(found)

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of the command ``worlds``."""
        from analysis.report.provenance import SCHEMA_VERSION

        return {
            "schema_version": SCHEMA_VERSION,
            "source": self.source,
            "count": len(self),
            "worlds": [
                {
                    "name": name,
                    "obstacles": len(each.obstacles),
                    "start_m": [*each.start_m],
                    "start_heading_deg": each.heading_deg,
                    "goal_m": [*each.goal_m],
                    "path_length_m": each.path_length_m,
                    "map": each.map_file,
                }
                for name, each in self._found.items()
            ],
        }

    def __str__(self) -> str:
        """Returns a heading, and one line per world."""
        first = next(iter(self))
        prefix, whose = f"{self.source}:", f"of {self.source}"
        if self.source == "shipped":
            prefix, whose = "", "that come with phonotaxis"
        more = f"phonotaxis simulate barn --set world={prefix}{first} runs one"
        return f"{len(self)} worlds {whose}\n{self!r}\n{more}"


def _about(world: World) -> str:
    (x, y), (goal_x, goal_y) = world.start_m, world.goal_m
    length = world.path_length_m
    what = f"{len(world.obstacles)} obstacles" if world.map_file is None else "map"
    return f"{what}, from ({x:g}, {y:g}) to ({goal_x:g}, {goal_y:g}) m, " + (
        "no path length" if length is None else f"path {length:.2f} m"
    )


def worlds(source: str | Path = "shipped") -> Worlds:
    """Lists the worlds of a set (docs/worlds.md).

    Args:
        source: ``shipped`` for the worlds that come with phonotaxis, or a folder.

    Returns:
        The worlds by name.

    Raises:
        InputError: The folder has no worlds, or a file is not valid.
    """
    from diagrams.scenario.worlds.catalog import open_worlds

    found = {name: read() for name, read in open_worlds(source).items()}
    return Worlds(str(source), found)
