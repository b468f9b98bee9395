"""Makes objects from a user's own classes, with the arguments that they accept."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from diagrams.scenario.own_code import is_interrupt, why
from systems.framework.input_error import InputError


def made(name: str, field: str, maker: type, parts: Mapping[str, Any]) -> Any:
    """Makes an object from a user's class, with the arguments that the class accepts.

    Args:
        name: Name of the class, for messages.
        field: Field of the scenario that contains the name, for messages.
        maker: The class. If it is a scalar-templated class of Drake, the signature of
            its ``_construct`` counts.
        parts: Values of the available arguments, by name of the argument.

    Returns:
        The object.

    Raises:
        InputError: The object cannot be made.
    """
    try:
        return maker(**asked_for(maker, parts))
    except BaseException as error:  # a user's class may raise any exception
        if is_interrupt(error):
            raise
        raise InputError(
            field,
            f"{name!r} cannot be made ({why(error)}); it may take {', '.join(parts)}",
        ) from error


def asked_for(maker: type, parts: Mapping[str, Any]) -> dict[str, Any]:
    """Selects the arguments that a class accepts, by the signature of its constructor.

    A constructor with ``**kwargs`` passes keywords on to its base class. The function
    then also considers the constructor of the base class. If all base classes have
    ``**kwargs``, the class accepts all arguments.

    Args:
        maker: The class, see ``made``.
        parts: Values of the available arguments, by name of the argument.

    Returns:
        The accepted arguments.
    """
    asked: set[str] = set()
    any_keyword = False
    for construct in constructors(maker):
        signature = inspect.signature(construct).parameters.values()
        asked.update(own.name for own in signature)
        any_keyword = _takes_any(construct)
    return {key: parts[key] for key in parts if any_keyword or key in asked}


def constructors(maker: type) -> Iterator[Callable[..., Any]]:
    """Yields the functions whose arguments the constructor of a class accepts.

    The first one is that of the class itself. While they have ``**kwargs``, those of
    the base classes follow.

    Args:
        maker: The class. For a scalar-templated class of Drake, the function is
            ``_construct``.

    Yields:
        Functions with ``self`` as their first argument.
    """
    for each in maker.__mro__:
        construct = vars(each).get("_construct") or vars(each).get("__init__")
        if inspect.isfunction(construct):
            yield construct
            if not _takes_any(construct):
                break


def _takes_any(function: Callable[..., Any]) -> bool:
    parameters = inspect.signature(function).parameters.values()
    return any(each.kind is each.VAR_KEYWORD for each in parameters)
