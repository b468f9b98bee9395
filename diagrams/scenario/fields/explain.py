"""Converts validation errors of pydantic to messages, one line per fault."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pydantic_core import ErrorDetails, ValidationError

from diagrams.scenario.fields.near_miss import near_field
from diagrams.scenario.former_fields import constant_now
from diagrams.scenario.shorthand import ROBOT_FIELDS
from systems.framework.input_error import InputError, shortened
from systems.laws.catalog import LAWS

#: What robots of each kind do, for messages.
_KINDS = {
    "follower": "follow a sound",
    "router": "drive on a route",
    "odor_searcher": "search for an odor",
    "sound_searcher": "search for a sound",
}


def explain(
    error: ValidationError,
    schema: Mapping[str, Any],
    what: str,
    written: Callable[[Sequence[str]], list[str]] = list,
) -> InputError:
    """Converts the faults that pydantic found in a user's data to one error message.

    Each fault becomes one line with the field, its value and the remedy.

    Args:
        error: Error from pydantic.
        schema: JSON Schema of the validated data.
        what: Name of the data for users, for example 'a scenario'.
        written: Function that converts the path of a field in the validated data to its
            path in the user's data.

    Returns:
        The error to raise.
    """
    found = _of_likely_branches(error.errors(include_url=False))
    faults = [fault for each in found for fault in _faults(each, schema, what, written)]
    return InputError.joined(faults)


def _of_likely_branches(found: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Keeps the errors of one type if the type of a field is a choice of types.

    pydantic reports the errors of all types of the choice. The type to keep is the one
    that the value comes nearest to: one of whose elements is wrong, or a text for a
    text. The name of the type, for example ``literal['found']``, leaves the path.
    """
    kept: dict[tuple[int | str, ...], ErrorDetails] = {}
    for each in found:
        place = [isinstance(part, str) and "[" in part for part in each["loc"]]
        if True not in place or each["loc"][-1] == "[key]":
            kept[each["loc"]] = each
            continue
        at = place.index(True)
        field, below = each["loc"][:at], each["loc"][at + 1 :]
        other = kept.get(field)
        as_text = isinstance(each["input"], str) and each["type"] == "literal_error"
        if other is None or below or as_text:
            kept.pop(field, None)
            kept[(*field, *below)] = {**each, "loc": (*field, *below)}
        # An element is wrong: the errors of the whole value do not matter.
        if any(loc[:at] == field and len(loc) > at for loc in kept):
            kept.pop(field, None)
    return list(kept.values())


def _faults(
    details: ErrorDetails,
    schema: Mapping[str, Any],
    what: str,
    written: Callable[[Sequence[str]], list[str]],
) -> Iterator[InputError]:
    loc = [str(part) for part in details["loc"] if part != "[key]"]
    place = written(loc)
    field, kind = ".".join(place), details["type"]
    message = details["msg"]
    if kind == "extra_forbidden":
        yield InputError(field, _unknown(loc, place, schema, what))
    elif kind == "missing":
        yield InputError(field, "is missing; set it")
    elif kind == "value_error":
        # A validator of several fields names the field to correct.
        inner = details["ctx"]["error"]
        if not isinstance(inner, InputError):
            inner = InputError("", str(inner))
        for fault in inner.all:
            below = fault.field.split(".") if fault.field else []
            yield InputError(".".join(written([*loc, *below])), fault.message)
    else:
        # Replace words of Python by words of YAML.
        message = re.sub(r"dictionary( or instance of \w+)?", "mapping", message)
        message = message.replace("valid tuple", "valid list")
        given = details["input"]
        value = "null" if given is None else shortened(repr(given), 80)
        yield InputError(field, f"is {value}; {message[0].lower()}{message[1:]}")


def _unknown(
    loc: Sequence[str], place: Sequence[str], schema: Mapping[str, Any], what: str
) -> str:
    """Returns the message for an unknown field, or for one of another kind of robot."""
    kinds = ROBOT_FIELDS.get(loc[3], ()) if len(loc) == 4 and loc[0] == "robots" else ()
    if kinds:
        laws = [name for name, law in LAWS.items() if law.robot in kinds]
        return (
            f"is not a field of robots that {_KINDS[loc[2]]}; remove it, or use one of "
            f"the laws {', '.join(laws)}"
        )
    if constant := constant_now(".".join(loc[3:] if loc[0] == "robots" else loc)):
        return f"is no longer a field; it is now {constant}; remove it"
    hint = near_field(schema, place)
    if not hint and place[-2:-1] == ["laws"]:
        return "is not a law of phonotaxis; write gains of your own law as own_gains"
    return f"is not a field of {what}{hint or '; remove it'}"
