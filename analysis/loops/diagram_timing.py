"""Times at which a Drake diagram updates its discrete state."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from systems.framework.input_error import InputError

#: Largest number of updates in one period of a diagram.
_MOST_UPDATES = 100_000
#: Largest relative error of a period that is read as a fraction of whole numbers.
_RATIO_ERROR = 1e-12
#: Times that differ by less than this share of a period are the same time.
_SAME = 1e-6


class Timing(NamedTuple):
    """Periodic updates at the times ``offset_s + k period_s`` (k = 0, 1, 2, ...)."""

    period_s: float
    offset_s: float

    def first_from(self, time_s: float) -> float:
        """Returns the first update that is not before ``time_s``, as Drake computes it.

        An update that differs from ``time_s`` by rounding counts as one at ``time_s``.
        """
        k = (time_s - self.offset_s) / self.period_s
        return self.offset_s + max(math.ceil(k - _SAME), 0) * self.period_s


class BlockTiming(NamedTuple):
    """Discrete updates of one block."""

    path: str
    timing: Timing | None
    """None: Drake names no single period."""


def leaf_systems(system: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yields the path and the system of each leaf, in the order of their states.

    The path has the names of the systems inside ``system``, joined by slashes. It is
    the name of ``system`` if that is a leaf.
    """
    if not hasattr(system, "GetSystems"):
        yield path or system.get_name(), system
        return
    for part in system.GetSystems():
        name = part.get_name()
        yield from leaf_systems(part, f"{path}/{name}" if path else name)


def block_timings(system: Any) -> list[BlockTiming]:
    """Lists the discrete updates of all blocks with a discrete state."""
    found = []
    for path, leaf in leaf_systems(system):
        if leaf.num_discrete_state_groups() == 0:
            continue
        event = leaf.GetUniquePeriodicDiscreteUpdateAttribute()
        timing = event and Timing(event.period_sec(), event.offset_sec())
        found.append(BlockTiming(path, timing))
    return found


def common_period(timings: Sequence[Timing]) -> float:
    """Returns the least common multiple of all periods, s.

    If the common multiple has more than 100,000 updates, the function raises an
    ``InputError``.
    """
    ratios = [_ratio(timing.period_s) for timing in timings]
    numerators = math.lcm(*(ratio.numerator for ratio in ratios))
    common = Fraction(numerators, math.gcd(*(ratio.denominator for ratio in ratios)))
    updates = sum(common / ratio for ratio in ratios)
    if updates > _MOST_UPDATES:
        periods = ", ".join(f"{period:g}" for period in sorted({*map(float, ratios)}))
        raise InputError(
            "diagram",
            f"has the periods {periods} s, which repeat after {float(common):g} s and "
            f"{float(updates):.3g} updates; choose periods with a smaller common "
            "multiple, or state period_s",
        )
    return float(common)


def _ratio(period_s: float) -> Fraction:
    ratio = Fraction(period_s).limit_denominator(10**9)
    if ratio == 0 or abs(float(ratio) / period_s - 1.0) > _RATIO_ERROR:
        return Fraction(period_s)
    return ratio


def first_update(timings: Sequence[Timing], time_s: float) -> float:
    """Returns the beginning of a period at ``time_s``, before all of its updates, s.

    Drake computes the times of updates with rounding errors. Updates that are at
    ``time_s`` up to such errors belong to the period that begins there.
    """
    times = [timing.first_from(time_s) for timing in timings]
    near = [
        time
        for time, timing in zip(times, timings, strict=True)
        if abs(time - time_s) < _SAME * timing.period_s
    ]
    return min(near, default=time_s)
