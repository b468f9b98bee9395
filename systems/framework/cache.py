"""One computation behind several output ports."""

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
    """Declares a cache entry that holds what ``compute(context)`` returns.

    Ports that share it take ``{entry.ticket()}`` as their prerequisite and
    read ``entry.Eval(context)``; they must not change the object.

    Args:
        system: The block.
        description: Name of the entry.
        compute: Takes a context; returns any object.
        prerequisites: Tickets of what ``compute`` reads: ports, states, time.

    Returns:
        The entry, to be evaluated in a context.
    """

    def calc(context: Any, value: Any) -> None:
        value.set_value(compute(context))

    producer = ValueProducer(allocate=lambda: Value(object()), calc=calc)
    return system.DeclareCacheEntry(
        description, producer, prerequisites_of_calc=prerequisites
    )
