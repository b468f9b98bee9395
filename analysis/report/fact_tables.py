"""Tables of named values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from analysis.report.section import Table, number

#: Endings of names, and the units that they mean; longest endings first.
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
#: Greatest length of a list in a table. Longer lists are in the JSON document only.
_LONGEST = 8


def readable_name(name: str) -> str:
    """Makes a name readable: `top_energy_j` becomes 'top energy (J)'."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending):
            return f"{_words(name.removesuffix(ending))} ({unit})"
    return _words(name)


def _words(name: str) -> str:
    return name.replace("_", " ")


def fact_table(
    facts: Mapping[str, Any], *, skip: Sequence[str] = (), caption: str = ""
) -> Table:
    """Makes a table with two columns: the name and the value of each fact.

    The values in ``facts`` are plain values (see ``analysis.report.plain_values``). If
    a value is a mapping, each of its entries has a row. The name in this row begins
    with the name of the mapping. The table omits lists of mappings, lists of lists, and
    lists of more than 8 values. It also omits the facts in ``skip``, which are given by
    key or by dotted path.
    """
    rows = list(_facts(facts, "", "", frozenset(skip)))
    return Table(["", ""], rows, caption)


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
