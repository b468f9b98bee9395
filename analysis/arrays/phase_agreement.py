"""Computes how well the phases of channels agree on delays, and the best delays."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from systems.framework.compiling import njit

_STEPS = 12
# The search ends if the steps are below this share of a quarter of the shortest period.
_SETTLED = 1e-4


@lru_cache
def pairs_of(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns the first and the second channel of each of the p pairs of channels."""
    first, second = np.triu_indices(count, 1)
    return first, second


def pair_delays(tau: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the (p,) delays of pairs from (n - 1,) delays after channel 0, s."""
    later = np.concatenate(([0.0], tau))
    first, second = pairs_of(later.size)
    return later[second] - later[first]


def climb(
    cross: NDArray[np.complex128],
    gain: NDArray[np.float64],
    w: NDArray[np.float64],
    tau: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Maximizes the agreement by Newton's method, at most a quarter period per step.

    The period is that of the highest frequency with a weight.
    """
    top = w[np.flatnonzero(gain)[-1]]
    limit = 0.5 * math.pi / top
    edges = np.array([0, w.size])
    for _ in range(_STEPS):
        slope, curve, _ = sums(cross, gain, w, tau, edges)
        try:
            step = np.linalg.solve(curve, slope[0])
        except np.linalg.LinAlgError:
            return tau
        if slope[0] @ step <= 0.0:
            return tau
        step *= min(1.0, limit / np.abs(step).max())
        tau = tau + step
        if np.abs(step).max() < _SETTLED * limit:
            break
    return tau


@njit(cache=True)
def sums(  # pragma: no cover  (compiled)
    cross: Any, gain: Any, w: Any, tau: Any, edges: Any
) -> tuple[Any, Any, float]:
    """Computes the agreement of the channels and its derivatives.

    The agreement is the sum over all pairs and frequencies of Re(cross e^(j w delay)).
    The results are the (b, n - 1) slopes of the agreement in b bands with respect to
    the delays, its (n - 1, n - 1) negative second derivative, and the agreement itself.
    """
    bands, count = edges.size - 1, tau.size + 1
    slope = np.zeros((bands, count - 1))
    curve = np.zeros((count - 1, count - 1))
    agreement = 0.0
    p = 0
    for i in range(count):
        for j in range(i + 1, count):
            t = tau[j - 1] - (tau[i - 1] if i > 0 else 0.0)
            bend = 0.0
            for b in range(bands):
                rise = 0.0
                for k in range(edges[b], edges[b + 1]):
                    if gain[k] == 0.0:
                        continue
                    angle = w[k] * t
                    cosine, sine = math.cos(angle), math.sin(angle)
                    z = cross[p, k]
                    real = gain[k] * (z.real * cosine - z.imag * sine)
                    imag = gain[k] * (z.real * sine + z.imag * cosine)
                    agreement += real
                    rise -= w[k] * imag
                    bend += w[k] * w[k] * real
                slope[b, j - 1] += rise
                if i > 0:
                    slope[b, i - 1] -= rise
            curve[j - 1, j - 1] += bend
            if i > 0:
                curve[i - 1, i - 1] += bend
                curve[i - 1, j - 1] -= bend
                curve[j - 1, i - 1] -= bend
            p += 1
    return slope, curve, agreement
