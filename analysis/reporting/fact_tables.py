"""Tables of named numbers: what a data object says of itself, for readers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from analysis.reporting.html_page import Cell, number, table

#: Endings of names, longest first, and what they stand for.
_UNITS = {
    "_n_s_m": "N s/m",
    "_rad_s3": "rad/s\u00b3",
    "_m_s3": "m/s\u00b3",
    "_rad_m": "rad/m",
    "_rad_s": "rad/s",
    "_per_s": "1/s",
    "_1_s": "1/s",
    "_m_s2": "m/s\u00b2",
    "_n_m": "N/m",
    "_m_s": "m/s",
    "_deg": "deg",
    "_db": "dB",
    "_rad": "rad",
    "_j": "J",
    "_n": "N",
    "_m": "m",
    "_s": "s",
}
#: Longer lists than this are left to the JSON document.
_LONGEST = 8


def readable_name(name: str) -> str:
    """`top_kinetic_energy_j` as 'top kinetic energy (J)'."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return f"{_words(name.removesuffix(ending))} ({unit})"
    return _words(name)


def _words(name: str) -> str:
    return name.replace("_", " ")


def fact_table(
    facts: Mapping[str, Any], *, skip: Sequence[str] = (), caption: str = ""
) -> str:
    """Two columns, what and how much; groups in groups.

    Args:
        facts: Plain values (see ``analysis.reporting.plain_values``). Long lists and
            lists of mappings are left out.
        skip: Keys, or dotted paths, to leave out.
        caption: Stands above.

    Returns:
        HTML.
    """
    rows = list(_facts(facts, "", "", frozenset(skip)))
    return table(["", ""], rows, caption=caption)


def _facts(
    facts: Mapping[str, Any], path: str, prefix: str, skip: frozenset[str]
) -> Any:
    for key, value in facts.items():
        if f"{path}{key}" in skip or key in skip:
            continue
        name = f"{prefix}{readable_name(key)}"
        if isinstance(value, Mapping):
            yield from _facts(value, f"{path}{key}.", f"{name}: ", skip)
        elif (cell := _cell(value)) is not _LEFT_OUT:
            yield name, cell


_LEFT_OUT = object()


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value.replace("_", " ") if value.isidentifier() else value
    if not isinstance(value, Sequence):
        return value
    short = len(value) <= _LONGEST
    if short and all(isinstance(item, int | float | str) for item in value):
        return ", ".join(
            item if isinstance(item, str) else number(item) for item in value
        )
    return _LEFT_OUT


def row_table(rows: Sequence[Mapping[str, Any]], *, caption: str = "") -> str:
    """A table with a row for each mapping; columns are the first one's keys.

    Args:
        rows: Plain values by name; values that a cell cannot hold are left out.
        caption: Stands above.

    Returns:
        HTML; empty where there are no rows.
    """
    if not rows:
        return ""
    keys = [k for k, value in rows[0].items() if _cell(value) is not _LEFT_OUT]
    body: list[list[Cell]] = [[_cell(row.get(key)) for key in keys] for row in rows]
    return table([readable_name(key) for key in keys], body, caption=caption)
