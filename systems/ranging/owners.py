"""Which body each rectangle on the ports ``poses_WO`` and ``sizes`` belongs to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def owners_of(count: int, owners: Sequence[int] | None) -> NDArray[np.int64]:
    """Returns the (count,) number of the body of each rectangle.

    If ``owners`` is None, each rectangle is a body of its own.
    """
    return np.arange(count) if owners is None else np.array(owners, dtype=np.int64)


def with_last(owners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Appends the number of one more body, which consists of one rectangle."""
    return np.append(owners, owners.max(initial=-1) + 1)
