"""Converts delays at microphones on a body to delays in free air."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.arrays.aligned_delays import AlignedDelays
from analysis.arrays.far_field import locate_far_source
from systems.sound.array_shape import ArrayShape

Delays = TypeVar("Delays", bound=AlignedDelays)

# Number of iterations. The conversion depends on the direction of the source.
_ROUNDS = 6


def in_free_air(delays: Delays, shape: ArrayShape, c: float) -> Delays:
    """Converts delays at microphones on a body to those of ``shape`` in free air.

    The conversion applies to distant sources. Without a body, the delays stay as they
    are.
    """
    if shape.body is None:
        return delays
    tau = free_air_delays(delays.tau, delays.covariance, shape, c)
    return replace(delays, tau=tau)


def free_air_delays(
    tau: NDArray[np.float64],
    covariance: NDArray[np.float64],
    shape: ArrayShape,
    c: float,
) -> NDArray[np.float64]:
    """Converts (n - 1,) delays with their covariance; see ``in_free_air``.

    With c = 1, the delays are differences of paths, m.
    """
    if shape.body is None:
        return tau
    # All channels count about equally, because the errors of the model do not depend on
    # the noise.
    faster = shape.body.c / c
    allowed = (faster * shape.body.arrival_std_s) ** 2 * (np.eye(tau.size) + 1.0)
    free = tau
    for _ in range(_ROUNDS):
        u = locate_far_source(free, covariance + allowed, shape, c).p_AS
        later = faster * shape.body.later(u)
        free = tau - (later[1:] - later[0])
    return free
