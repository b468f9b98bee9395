"""Lists of what the package contains: its scenarios and its laws."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping

__all__ = ["Listing", "laws", "scenarios"]


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
