"""What pydantic finds wrong, as one line of our own for each fault."""

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
    """All complaints, each as field, value and remedy on one line.

    Args:
        error: What pydantic found.
        schema: JSON Schema of what it validated.
        what: What that is to a user, as 'a scenario'.

    Returns:
        The error, to be raised.
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
    """What is wrong with single fields of some changes.

    What takes several fields to judge is not: the others are not known here.

    Args:
        model: Of what is changed.
        data: Changed fields.
        schema: JSON Schema of a scenario.
        place: Where in it they are: group and name.

    Returns:
        A fault each, whose field begins with the name.
    """
    try:
        model.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        single = [
            each
            for each in found
            # Of a validator of several fields the input is all of them.
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
    """The faults; fields begin below the first part of what is ``above`` them."""
    below = [str(part) for part in details["loc"] if part != "[key]"]
    place = [*above, *below]
    field, kind = ".".join([*above[1:], *below]), details["type"]
    message = details["msg"]
    if kind == "extra_forbidden":
        near = near_field(schema, place)
        yield InputError(field, f"is not a field of {what}; remove it{near}")
    elif kind == "value_error":
        # A validator of several fields names the one to mend.
        inner = details["ctx"]["error"]
        if not isinstance(inner, InputError):
            inner = InputError("", str(inner))
        yield InputError.joined([inner], below=field)
    else:
        # Words of YAML for words of Python.
        message = re.sub(r"dictionary( or instance of \w+)?", "mapping", message)
        message = message.replace("valid tuple", "valid list")
        value = shortened(repr(details["input"]), 80)
        yield InputError(field, f"is {value}; {message[0].lower()}{message[1:]}")
