"""Lists the fields of a scenario that differ from their defaults."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from diagrams.scenario.scenario import Scenario, scenario_from_mapping
from systems.framework.input_error import InputError, shortened

#: Limits of the text: number of fields, and characters of a value.
_MOST_FIELDS, _LONGEST = 40, 100
#: Fields that name a scenario.
_NAMES = ("name", "description")


def differences(scenario: Scenario) -> dict[str, Any]:
    """Returns the fields of a scenario that differ from their defaults.

    Args:
        scenario: The scenario.

    Returns:
        Plain values by dotted path, without the name and the description. Fields of
        robots with other laws have the defaults of these laws.
    """
    plain = scenario.model_dump(mode="json")
    try:
        usual = scenario_from_mapping({"law": plain["law"]} if "law" in plain else {})
    except InputError:  # the law needs more fields
        usual = Scenario()
    law = Scenario().model_dump(mode="json")["law"]
    defaults = {**usual.model_dump(mode="json"), "law": law}
    return dict(_different(plain, defaults, ""))


def differences_text(scenario: Scenario) -> str:
    """Lists the fields that differ from their defaults as comments of YAML."""
    found = differences(scenario)
    lines = [
        f"#   {path}: {shortened(json.dumps(value), _LONGEST)}"
        for path, value in [*found.items()][:_MOST_FIELDS]
    ]
    if more := len(found) - len(lines):
        lines.append(f"#   and {more} more fields")
    head = "# Fields that differ from their defaults:" if lines else "# All defaults."
    return "\n".join([head, *lines, "# All fields:", ""])


def _different(
    tree: Mapping[str, Any], usual: Mapping[str, Any], above: str
) -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        path, other = f"{above}{key}", usual.get(key)
        if path in _NAMES or value == other:
            continue
        if isinstance(value, Mapping) and value:
            below = other if isinstance(other, Mapping) else {}
            yield from _different(value, below, f"{path}.")
        elif value != {}:
            yield path, value
