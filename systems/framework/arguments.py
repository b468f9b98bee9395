"""Checks parameter models among the arguments of a block's constructor."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from systems.framework.input_error import InputError, shortened
from systems.framework.parameters import Parameters

_PLAIN = (bool, int, float, str, list, tuple, set)


def with_checked_parameters(construct: Callable[..., None]) -> Callable[..., None]:
    """Returns a constructor that also accepts mappings as parameter models.

    Args:
        construct: Constructor of a block. An argument is a parameter model if its
            default is one.

    Returns:
        A constructor with the same signature. It validates a mapping, and raises an
        ``InputError`` if an argument is no parameter model.
    """
    models = {
        name: type(each.default)
        for name, each in inspect.signature(construct).parameters.items()
        if isinstance(each.default, Parameters)
    }
    if not models:
        return construct

    @functools.wraps(construct)
    def construct_checked(self: Any, *arguments: Any, **options: Any) -> None:
        for name in models.keys() & options.keys():
            value, model = options[name], models[name]
            if isinstance(value, (Mapping, *_PLAIN)):
                options[name] = _validated(name, model, value)
        construct(self, *arguments, **options)

    return construct_checked


def _validated(name: str, model: type[Parameters], value: Any) -> Parameters:
    if not isinstance(value, Mapping):
        raise InputError(
            name,
            f"is {shortened(repr(value), 80)}; write {name}={model.__name__}(...), or "
            f"{name}={{'{next(iter(model.model_fields))}': ...}}",
        )
    try:
        return model.model_validate(dict(value))
    except ValidationError as error:
        raise InputError.joined(
            (_explained(model, each) for each in error.errors(include_url=False)), name
        ) from None


def _explained(model: type[Parameters], fault: Any) -> InputError:
    field = ".".join(map(str, fault["loc"]))
    own = fault.get("ctx", {}).get("error")
    if isinstance(own, InputError):
        return InputError(".".join(filter(None, (field, own.field))), own.message)
    if fault["type"] == "extra_forbidden":
        known = ", ".join(model.model_fields)
        return InputError(field, f"is no field of {model.__name__}; use {known}")
    message = f"{fault['msg'][0].lower()}{fault['msg'][1:]}"
    return InputError(field, f"is {shortened(repr(fault['input']), 80)}; {message}")
