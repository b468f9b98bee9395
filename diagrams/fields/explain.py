"""What pydantic finds wrong, as one line of our own for each fault."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic_core import ErrorDetails, ValidationError

from diagrams.fields.near_miss import near_field
from systems.framework.input_error import InputError, shortened

__all__ = ["explain"]


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


def _faults(
    details: ErrorDetails, schema: Mapping[str, Any], what: str
) -> Iterator[InputError]:
    place = [str(part) for part in details["loc"] if part != "[key]"]
    field, kind, message = ".".join(place), details["type"], details["msg"]
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
