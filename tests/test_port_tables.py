"""The port table in each block's docstring is the truth about its ports."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass
from typing import Any

import pytest
from pydrake.systems.framework import LeafSystem, PortDataType
from ruamel.yaml import YAML

import systems
from analysis.arrays.voting.source_listener_block import SourceListener
from systems.base.parameters import PlantParameters

pytestmark = pytest.mark.drake

BLOCKS: dict[str, Any] = {
    name: value
    for name in systems.__all__
    if name != "WheelSpeedCommand"  # another name of WheelCommand
    and inspect.isclass(value := getattr(systems, name))
    and issubclass(value, LeafSystem)
    and value is not systems.Block
} | {"SourceListener": SourceListener}
#: Those that convert to other scalars.
TEMPLATED = {name for name in BLOCKS if hasattr(systems, f"{name}_")}
# A rounded angle has no derivative, and the block says so.
DIFFERENTIABLE = {
    "WheelOdometry": {"plant": PlantParameters(pulses_per_revolution=None)}
}
UNITS = {
    "0 or 1", "1", "dBm", "deg", "m", "m/s", "m/s^2", "m^2", "N", "number", "rad",
    "rad/s", "s"
}  # fmt: skip
UNIT = re.compile(f"(?:{'|'.join(map(re.escape, UNITS))})(?=,| |$)")
DIRECTIVE = re.compile(
    r"^\.\. pydrake_system::\n(?P<body>(?:\n|[ \t]+.*\n)+)", re.MULTILINE
)
ENTRY = re.compile(r"(?P<name>\w+) \[(?P<content>.+)\](?: \(optional\))?")


@dataclass(frozen=True)
class PortRow:
    """One line of a port table."""

    name: str
    content: str
    """What stands in the brackets: units of the elements, or a type."""


@dataclass(frozen=True)
class PortTable:
    """What a docstring says of a block."""

    name: str
    inputs: list[PortRow]
    outputs: list[PortRow]


def read_port_table(docstring: str) -> PortTable:
    """Parse the `.. pydrake_system::` part of a docstring.

    Raises:
        ValueError: There is no such part, or an entry names no unit or type.
    """
    match = DIRECTIVE.search(inspect.cleandoc(docstring) + "\n")
    if match is None:
        raise ValueError("no `.. pydrake_system::` in the docstring")
    table = YAML(typ="safe").load(inspect.cleandoc("\n" + match["body"]))
    return PortTable(
        name=table["name"],
        inputs=[_row(entry) for entry in table.get("input_ports", [])],
        outputs=[_row(entry) for entry in table.get("output_ports", [])],
    )


def _row(entry: Any) -> PortRow:
    match = ENTRY.fullmatch(str(entry))
    if match is None:
        raise ValueError(f"{entry!r} is not of the form `port [unit or type]`")
    return PortRow(match["name"], match["content"])


def check_content(row: PortRow, port: Any) -> None:
    """A type for an abstract port; else units of elements, which may be explained.

    One unit holds for all elements, several ones for one element each, or, where
    the last one says `each`, for one group of elements each.
    """
    if port.get_data_type() == PortDataType.kAbstractValued:
        assert re.fullmatch(r"[A-Z]\w+", row.content), f"{row} names no type"
        return
    assert UNIT.match(row.content), f"{row} begins with no known unit"
    units = row.content.split(", ")
    if len(units) > 1 and {unit.removesuffix(" each") for unit in units} <= UNITS:
        size = port.size()
        each = units[-1].endswith(" each")
        assert (size % len(units) if each else size - len(units)) == 0, (
            f"{row} does not fit {size} elements"
        )


def ports_of(system: Any) -> tuple[list[Any], list[Any]]:
    inputs = [system.get_input_port(i) for i in range(system.num_input_ports())]
    outputs = [system.get_output_port(i) for i in range(system.num_output_ports())]
    return inputs, outputs


def names(items: list[Any]) -> list[str]:
    return [item.get_name() for item in items]


@pytest.mark.parametrize("name", sorted(BLOCKS))
def test_port_table_equals_ports(name: str) -> None:
    block = BLOCKS[name]
    table = read_port_table(block.__doc__)
    inputs, outputs = ports_of(block())
    assert table.name == name
    assert [row.name for row in table.inputs] == names(inputs)
    assert [row.name for row in table.outputs] == names(outputs)
    for row, port in zip(table.inputs + table.outputs, inputs + outputs, strict=True):
        check_content(row, port)


@pytest.mark.parametrize("name", sorted(TEMPLATED))
def test_ports_survive_scalar_conversion(name: str) -> None:
    block = getattr(systems, name)(**DIFFERENTIABLE.get(name, {}))
    inputs, outputs = ports_of(block)
    converted_inputs, converted_outputs = ports_of(block.ToAutoDiffXd())
    assert names(converted_inputs) == names(inputs)
    assert names(converted_outputs) == names(outputs)


def test_reader_takes_the_table_apart() -> None:
    table = read_port_table(
        """One line.

        .. pydrake_system::

            name: Block
            input_ports:
            - pose_WB [m, m, rad]
            - poses_WO [m, m, rad each] (optional)
            output_ports:
            - audio [AudioFrame]

        Prose.
        """
    )
    assert table == PortTable(
        name="Block",
        inputs=[
            PortRow("pose_WB", "m, m, rad"),
            PortRow("poses_WO", "m, m, rad each"),
        ],
        outputs=[PortRow("audio", "AudioFrame")],
    )


@pytest.mark.parametrize(
    ("docstring", "message"),
    [
        ("A block without a table.", "no `.. pydrake_system::`"),
        (
            "A.\n\n.. pydrake_system::\n\n    name: A\n    output_ports:\n    - speed",
            "'speed' is not of the form",
        ),
    ],
)
def test_reader_refuses_what_says_nothing(docstring: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_port_table(docstring)


@pytest.mark.parametrize(
    "content", ["meters", "AudioFrame", "rad, rad, rad", "sinister"]
)
def test_wrong_contents_are_found(content: str) -> None:
    port = systems.WheelOdometry().get_input_port(0)
    assert port.size() == 2
    with pytest.raises(AssertionError):
        check_content(PortRow("wheel_angles", content), port)
