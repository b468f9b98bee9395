"""Turns validation errors of pydantic into messages, one line per fault."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from pydantic_core import ErrorDetails, ValidationError

from diagrams.scenario.fields.near_miss import near_field
from systems.framework.input_error import InputError, shortened

if TYPE_CHECKING:
    from pydantic import BaseModel


def explain(error: ValidationError, schema: Mapping[str, Any], what: str) -> InputError:
    """Converts all faults, each into one line with field, value and remedy.

    Args:
        error: Error from pydantic.
        schema: JSON Schema of the validated data.
        what: Name of the data for users, for example 'a scenario'.

    Returns:
        The error to raise.
    """
    found = error.errors(include_url=False)
    return InputError.joined(
        each for details in found for each in _faults(details, schema, what)
    )


def single_faults(
    model: type[BaseModel],
    data: Mapping[str, Any],
    schema: Mapping[str, Any],
    place: tuple[str, str],
) -> list[InputError]:
    """Returns the faults of single fields among some changes.

    Faults that concern several fields are ignored, because the other fields are not
    known here.

    Args:
        model: Model of the changed group.
        data: Changed fields.
        schema: JSON Schema of a scenario.
        place: Group of the changes in the scenario (``robots`` or ``sources``), and the
            name in this group.

    Returns:
        The faults. Each path of a field begins with the name, without the group.
    """
    try:
        model.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        single = [
            each
            for each in found
            # A validator of several fields has a mapping of all fields as its input.
            if each["type"] != "value_error" or not isinstance(each["input"], Mapping)
        ]
        return [
            fault
            for each in single
            for fault in _faults(each, schema, "a scenario", place)
        ]
    return []


def _faults(
    details: ErrorDetails,
    schema: Mapping[str, Any],
    what: str,
    above: tuple[str, ...] = (),
) -> Iterator[InputError]:
    """Yields the faults of data at the place ``above``; paths omit its group."""
    below = [str(part) for part in details["loc"] if part != "[key]"]
    place = [*above, *below]
    field, kind = ".".join([*above[1:], *below]), details["type"]
    message = details["msg"]
    if kind == "extra_forbidden":
        near = near_field(schema, place)
        yield InputError(field, f"is not a field of {what}; remove it{near}")
    elif kind == "value_error":
        # A validator of several fields names the field to correct.
        inner = details["ctx"]["error"]
        if not isinstance(inner, InputError):
            inner = InputError("", str(inner))
        yield InputError.joined([inner], below=field)
    else:
        # Replace words of Python by words of YAML.
        message = re.sub(r"dictionary( or instance of \w+)?", "mapping", message)
        message = message.replace("valid tuple", "valid list")
        value = shortened(repr(details["input"]), 80)
        yield InputError(field, f"is {value}; {message[0].lower()}{message[1:]}")
