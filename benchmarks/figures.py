"""Figures beside their bounds, taken on one core."""

from __future__ import annotations

import os
from typing import Literal, NamedTuple

__all__ = ["Figure", "print_figures", "stay_on_one_core"]


class Figure(NamedTuple):
    """A measured value and what it must not miss."""

    name: str
    value: float
    sense: Literal["<=", ">="]
    bound: float


def stay_on_one_core() -> None:
    """From here on this process runs on one core, where the system can do it."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def print_figures(figures: list[Figure]) -> int:
    """Prints a line a figure.

    Returns:
        Exit status: 1 if one misses its bound.
    """
    missed = False
    for name, value, sense, bound in figures:
        met = value >= bound if sense == ">=" else value <= bound
        missed |= not met
        verdict = "" if met else "  MISSED"
        print(f"{name:<38} {value:8.2f}   {sense} {bound:g}{verdict}")
    return int(missed)
