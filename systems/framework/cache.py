"""Declares a cache entry that several output ports of a block use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydrake.common.value import Value
from pydrake.systems.framework import CacheEntry, DependencyTicket, ValueProducer


def declare_cache(
    system: Any,
    description: str,
    compute: Callable[[Any], Any],
    prerequisites: set[DependencyTicket],
) -> CacheEntry:
    """Declares a cache entry for the result of ``compute(context)``.

    An output port that uses the entry declares ``{entry.ticket()}`` as its
    prerequisite. The port reads the result with ``entry.Eval(context)`` and must not
    change it.

    Args:
        system: The block that owns the entry.
        description: Name of the entry.
        compute: Function of a context that returns any object.
        prerequisites: Dependency tickets of all ports, states and times that
            ``compute`` reads.

    Returns:
        The cache entry.
    """

    def calc(context: Any, value: Any) -> None:
        value.set_value(compute(context))

    producer = ValueProducer(allocate=lambda: Value(object()), calc=calc)
    return system.DeclareCacheEntry(
        description, producer, prerequisites_of_calc=prerequisites
    )
