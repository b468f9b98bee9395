"""Every column that a run can have is in the data dictionary, with its port's unit."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any, cast

import pytest

import phonotaxis
from analysis.runs.columns import COLUMNS, column_of, columns
from diagrams import build_sound_follower, library_scenarios, load_scenario
from systems.laws.catalog import LAWS, ROUTE_LAWS

#: Runs that have what no scenario of the library has.
OTHERS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("default", {"guard": {}}),
    ("default", {"plant.friction": 0.4}),
    ("default", {"ultrasonic.preset": "ring_12"}),
    ("crossing_obstacle", {"obstacle_sensing": "ultrasonic"}),
)
#: Ports whose elements are told in words.
IN_WORDS = {
    "guard_report": ("number", "m", "m", "m"),
    "plan": ("number", "m", "m", "m"),
    "impedance": ("N/m", "N s/m", "N/m"),
    "search_report": ("number",) * 4,
    "sensing_fault": ("number",) * 2,
}


#: What the sink tells of each robot; its port has them all in one.
SINK = {
    "sink_frames": "number",
    "sink_function": "number",
    "sink_value": "number",
    "sink_age_s": "s",
    "sink_result": "number",
}


def builds() -> Iterator[Any]:
    """Robots of the library's scenarios, and of every law."""
    chosen: list[tuple[str, dict[str, Any]]] = [
        *((name, {}) for name in library_scenarios()),
        *OTHERS,
    ]
    for name in LAWS:
        if name in ROUTE_LAWS:
            chosen.append(("crossing_obstacle", {"law": name}))
        elif "search" not in name:
            chosen.append(("default", {"law": name}))
    for scenario, overrides in chosen:
        follower = build_sound_follower(load_scenario(scenario, overrides), log=True)
        yield from follower.robots.values()


@pytest.fixture(scope="module")
def declared() -> dict[str, str]:
    """Units of all columns that blocks name, by their port tables."""
    units: dict[str, str] = {}
    for parts in builds():
        logged = {name for names in parts.logged.values() for name in names}
        for block in parts.blocks.values():
            for port, names in getattr(block, "columns", {}).items():
                for name, unit in zip(
                    names, port_units(block, port, names), strict=True
                ):
                    if name in logged:
                        assert units.setdefault(name, unit) == unit
        assert logged <= units.keys()
    return units | SINK


def port_units(block: Any, port: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """Of each element of an output port."""
    if port in IN_WORDS:
        return IN_WORDS[port]
    outputs = inspect.cleandoc(block.__doc__).partition("output_ports:")[2]
    found = re.search(rf"- {port} \[([^\]]*)\]", outputs)
    assert found, (type(block), port)
    parts = found[1].removesuffix(" each").split(", ")
    if len(parts) == len(names) and all(part in UNITS for part in parts):
        return tuple(parts)
    assert parts[0].split(" of ")[0] in UNITS, found[1]
    return (parts[0].split(" of ")[0],) * len(names)


UNITS = {column.unit for column in COLUMNS}


def test_every_column_has_its_ports_unit(declared):
    found = {name: column_of(name) for name in declared}
    assert not [name for name, column in found.items() if column is None]
    wrong = {
        name: (column.unit, declared[name])
        for name, column in found.items()
        if column is not None and column.unit != declared[name]
    }
    assert not wrong


def test_no_entry_is_of_a_column_that_is_gone(declared):
    """Those that follow from the log are in every table with hearing."""
    run = phonotaxis.simulate(
        load_scenario("default", {"hearing": "ideal", "duration_s": 0.05})
    )
    seen = {re.sub(r"(?<=_)\d+", "{k}", name, count=1) for name in declared}
    assert {column.name for column in COLUMNS} - seen - set(run.columns) == set()
    assert not [name for name in run.columns if column_of(name) is None]


def test_numbers_and_names_of_robots_are_read():
    column = column_of("second.collision_2_B_y")
    assert column is not None
    assert column.name == "second.collision_2_B_y"
    assert column.unit == "m"
    assert column.meaning == "leftward part of collision vector 2"
    assert column_of("rear_range") is None


def test_dictionary_of_names_keeps_their_order_and_own_columns():
    table = columns(["t", "rear_range", "range_3"])
    assert list(table.index) == ["t", "rear_range", "range_3"]
    assert table["unit"].tolist() == ["s", "", "m"]
    assert "sensor 3" in str(table.loc["range_3", "meaning"])
    assert list(columns().index) == [column.name for column in COLUMNS]


def test_a_scenario_is_no_run():
    with pytest.raises(phonotaxis.InputError, match="give a run"):
        columns(cast("Any", load_scenario("default")))
