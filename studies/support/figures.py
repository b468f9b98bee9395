"""Figures beside their bounds, taken on one core."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from studies.tables import MissedBoundError, Table


class Figure(NamedTuple):
    """A measured value and what it must not miss."""

    name: str
    value: float
    sense: Literal["<=", ">="]
    bound: float

    @property
    def met(self) -> bool:
        """Whether the value does not miss its bound."""
        if self.sense == ">=":
            return self.value >= self.bound
        return self.value <= self.bound


def stay_on_one_core() -> None:
    """From here on this process runs on one core, where the system can do it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def print_figures(figures: list[Figure]) -> int:
    """Prints a line a figure.

    Returns:
        Exit status: 1 if one misses its bound.
    """
    for figure in figures:
        name, value, sense, bound = figure
        verdict = "" if figure.met else "  MISSED"
        print(f"{name:<38} {value:8.2f}   {sense} {bound:g}{verdict}")
    return int(not all(figure.met for figure in figures))


def bounds_table(figures: Sequence[Figure]) -> Iterator[Table]:
    """Figures of a study beside their bounds.

    Args:
        figures: Of the whole study.

    Yields:
        One table.

    Raises:
        MissedBoundError: One of them misses its bound.
    """
    rows = [
        (name, f"{value:.3f}", f"{sense} {bound:g}")
        for name, value, sense, bound in figures
    ]
    yield Table("bounds", ("figure", "value", "bound"), rows)
    if missed := [figure.name for figure in figures if not figure.met]:
        raise MissedBoundError("; ".join(missed))
