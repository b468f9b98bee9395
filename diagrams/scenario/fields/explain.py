"""Converts validation errors of pydantic to messages, one line per fault."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pydantic_core import ErrorDetails, ValidationError

from diagrams.scenario.fields.field_list import list_fields
from diagrams.scenario.fields.near_miss import near_field
from diagrams.scenario.fields.schema_walk import at_place
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
#: Types of errors of pydantic. ``_FLAT`` is our own: numbers in place of lists.
_LISTS, _FLAT = ("list_type", "tuple_type"), "flat_list"
_RANGES = ("less_than", "less_than_equal", "greater_than", "greater_than_equal")
_MAPPINGS = ("model_type", "dict_type", "model_attributes_type", "mapping_type")


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
    found = _whole_lists(found)
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
        if each["type"] == "extra_forbidden":  # what the user has written
            place[-1] = False
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
        remedy = _of_type(details, field, schema) or message[0].lower() + message[1:]
        value = "empty (null)" if given is None else shortened(repr(given), 80)
        yield InputError(field, f"is {value}; {remedy}")


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
        return f"is no longer a field; {constant}; remove it"
    if near := near_field(schema, place):
        return f"did you mean {near!r}? {'.'.join(place)!r} is not a field of {what}"
    if place[-2:-1] == ["laws"]:
        return "is not a law of phonotaxis; write gains of your own law as own_gains"
    return f"is not a field of {what}; {_instead(place, schema, what)}remove it"


def _instead(place: Sequence[str], schema: Mapping[str, Any], what: str) -> str:
    """Lists the fields of the group, or names the command that finds fields."""
    *parents, last = place
    if parents and (siblings := list(at_place(schema, parents))):
        return f"{'.'.join(parents)} has {', '.join(siblings)}; use one of them, or "
    word = last.partition("_")[0].casefold()
    if what == "a scenario" and any(
        word in each.meaning.casefold().split() for each in list_fields(schema)
    ):
        return f"'phonotaxis fields {word}' lists fields with this word; use one, or "
    return ""


def _whole_lists(found: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Joins the errors of numbers that should be lists to one error of their list.

    A user who writes ``[2, 0]`` for a list of points gets one error for each number.
    """
    kept: list[ErrorDetails] = []
    for each in found:
        *above, last = each["loc"] or ("",)
        joins = each["type"] in _LISTS and isinstance(each["input"], int | float)
        if not joins or not isinstance(last, int) or isinstance(each["input"], bool):
            kept.append(each)
        elif kept and kept[-1]["loc"] == tuple(above) and kept[-1]["type"] == _FLAT:
            kept[-1]["input"].append(each["input"])
        else:
            joined = {"type": _FLAT, "loc": tuple(above), "input": [each["input"]]}
            kept.append({**each, **joined})  # type: ignore[typeddict-item]
    return kept


def _of_type(details: ErrorDetails, field: str, schema: Mapping[str, Any]) -> str:
    """Returns the remedy for a value of a wrong type; empty if there is none."""
    kind, given, text = details["type"], details["input"], ""
    known = next((each for each in list_fields(schema) if each.path == field), None)
    if kind == _FLAT:
        text = f"give a list of lists, {[given]}"
    elif kind in _LISTS and isinstance(given, str) and "," in given:
        text = f"give a list, [{given}]"
    elif kind in _LISTS:
        example = f", for example {known.default}" if known and known.default else ""
        text = f"give a list{example}"
    elif field == "law" and isinstance(given, list | tuple):
        text = "give one law; phonotaxis.simulate_laws(...) runs several"
    elif kind in _MAPPINGS and field == "laws":
        text = "these are gains; a law is chosen by the field law"
    elif kind in _MAPPINGS:
        text = "give its fields as a mapping; {} means their defaults"
        if isinstance(given, str) and given.casefold().endswith((".wav", ".flac")):
            text = f"write {field}.kind=wav and {field}.file={given}"
    elif kind in _RANGES and known:
        message = details["msg"][0].lower() + details["msg"][1:]
        text = f"{message} {known.unit}".rstrip()
    return text
