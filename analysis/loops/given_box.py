"""Boxes of uncertain parameters that users give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

Vector = NDArray[np.float64]


def named(names: list[str], values: Vector) -> dict[str, float]:
    """Returns (p,) values of parameters by name."""
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def box_ends(box: Mapping[str, Sequence[float]]) -> tuple[Vector, Vector, Vector]:
    """Returns the lower ends, nominal values and upper ends of a box, each (p,).

    Raises InputError if the box is empty, or if an interval is not in order.
    """
    if not box:
        raise InputError("box", "is empty; name a parameter with its interval")
    rows = []
    for name, ends in box.items():
        row = list(map(float, ends))
        if len(row) == 2:
            row.insert(1, 0.5 * (row[0] + row[1]))
        if len(row) != 3 or not row[0] <= row[1] <= row[2] or row[0] == row[2]:
            raise InputError(
                f"box[{name!r}]",
                f"is {tuple(ends)}; give (low, high) or (low, nominal, high), in order",
            )
        rows.append(row)
    low, nominal, high = np.array(rows).T
    return low, nominal, high
