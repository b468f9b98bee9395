"""Proof that no pole of a family of loops crosses a boundary of the plane of poles.

If the characteristic polynomial of one loop of the family has all zeros inside the
boundary, and if no polynomial of the family has a zero on the boundary, then all loops
of the family have all poles inside (zero exclusion principle, Barmish 1994). The values
of the polynomial over a part of the box and of the boundary lie in the convex hull of
its Bernstein coefficients. If this hull excludes zero, so do the values. Otherwise the
part is halved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.loops.parameter_polynomial import halves

#: Number of parts at each level at which the search looks for a counterexample.
_TRIALS = 12
#: Weight of the size of a part, against its curvature, in the choice of the cut.
_SIZE_WEIGHT = 0.02
#: Largest number of coefficients in one step of the computation.
_CHUNK = 2_000_000

Complex = NDArray[np.complex128]
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Exclusion:
    """Result of the search for zeros on the boundary."""

    outcome: Literal["excluded", "counterexample", "open"]
    """``excluded`` is a proof. ``open`` means that the limit of parts was reached."""
    parts: int
    """Number of parts that were examined."""
    shares: Vector | None = None
    """(p,) position of the counterexample in the box, 0 to 1."""


def exclude_zeros(
    control: NDArray[Any],
    error: Vector,
    boundary: Complex,
    violates: Callable[[Vector], bool],
    most_parts: int,
) -> Exclusion:
    """Searches for zeros of a polynomial on a boundary, for all parameters of a box.

    Args:
        control: (d_1 + 1, ..., d_p + 1, n) Bernstein coefficients over the box of the
            coefficients of the polynomial, highest power first.
        error: (n,) bound of the error of these coefficients of the polynomial.
        boundary: (n, n) matrix from these coefficients to Bernstein coefficients along
            the boundary; see ``homogeneous``.
        violates: Whether a point of the box, as (p,) shares, is a counterexample.
        most_parts: Largest number of parts to examine.

    Returns:
        Whether there is no zero.
    """
    values: Complex = control @ boundary.T
    allowed: Vector = np.abs(boundary) @ error
    shape, count = values.shape, values.ndim - 1
    parts, errors = values.reshape(1, -1), allowed[None]
    low, high = np.zeros((1, count)), np.ones((1, count))
    examined = 0
    while len(parts):
        examined += len(parts)
        left = ~_exclude(parts.reshape(len(parts), -1, shape[-1]), errors)
        parts, errors, low, high = parts[left], errors[left], low[left], high[left]
        if not len(parts):
            break
        middles = 0.5 * (low + high)
        nearest = np.argsort(np.abs(parts.mean(axis=1)))[:_TRIALS]
        for shares in np.unique(middles[nearest], axis=0):
            if violates(shares):
                return Exclusion("counterexample", examined, shares)
        if examined + 2 * len(parts) > most_parts:
            return Exclusion("open", examined)
        parts, errors, low, high = _halve(parts, errors, low, high, shape)
    return Exclusion("excluded", examined)


def _exclude(parts: Complex, errors: Vector) -> NDArray[np.bool_]:
    """Whether a half plane without zero contains the hull, for each part."""
    found = np.zeros(len(parts), dtype=bool)
    step = max(1, _CHUNK // parts[0].size)
    for start in range(0, len(parts), step):
        rows = slice(start, start + step)
        flat = parts[rows].reshape(len(parts[rows]), -1)
        angles = np.sort(np.angle(flat), axis=1)
        gaps = np.diff(angles, axis=1, append=angles[:, :1] + 2.0 * np.pi)
        widest = gaps.argmax(axis=1)[:, None]
        middle = np.take_along_axis(angles + 0.5 * gaps, widest, axis=1) + np.pi
        inner = (parts[rows] * np.exp(-1j * middle)[:, :, None]).real
        found[rows] = (inner > errors[rows, None, :]).all(axis=(1, 2))
    return found


def _halve(
    parts: Complex, errors: Vector, low: Vector, high: Vector, shape: tuple[int, ...]
) -> tuple[Complex, Vector, Vector, Vector]:
    """Halves each part along the axis along which it is most curved."""
    cut = _cuts(parts.reshape(len(parts), *shape))
    results: list[tuple[Complex, Vector, Vector, Vector]] = []
    for axis in np.unique(cut):
        chosen = cut == axis
        tensor = parts[chosen].reshape(-1, *shape)
        for upper, matrix in enumerate(halves(shape[axis] - 1)):
            moved = np.tensordot(tensor, matrix, axes=(axis + 1, 1))
            half = np.moveaxis(moved, -1, axis + 1).reshape(len(tensor), -1)
            begin, end, error = low[chosen], high[chosen], errors[chosen]
            if axis == len(shape) - 1:
                error = error @ matrix.T
            else:
                side = begin if upper else end
                side[:, axis] = 0.5 * (low[chosen, axis] + high[chosen, axis])
            results.append((half, error, begin, end))
    first, second, third, fourth = zip(*results, strict=True)
    return (
        np.concatenate(first),
        np.concatenate(second),
        np.concatenate(third),
        np.concatenate(fourth),
    )


def _cuts(tensor: Complex) -> NDArray[np.int64]:
    """Axis along which each part deviates most from a plane."""
    shape = tensor.shape[1:]
    every = tuple(range(1, tensor.ndim))
    plane = tensor.mean(axis=every, keepdims=True)
    for axis in every:
        others = tuple(k for k in every if k != axis)
        profile = tensor.mean(axis=others, keepdims=True)
        count = shape[axis - 1]
        ends = np.take(profile, [0, count - 1], axis=axis)
        places = np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1)
        along = [-1 if k == axis else 1 for k in range(tensor.ndim)]
        plane = plane + np.diff(ends, axis=axis) * places.reshape(along)
    rest = tensor - plane
    scores = np.stack(
        [_length(rest, axis) + _SIZE_WEIGHT * _length(tensor, axis) for axis in every],
        axis=1,
    )
    return np.asarray(scores.argmax(axis=1))


def _length(tensor: Complex, axis: int) -> Vector:
    """Longest way along an axis through the coefficients of each part."""
    steps = np.abs(np.diff(tensor, axis=axis)).sum(axis=axis)
    return np.asarray(steps.reshape(len(tensor), -1).max(axis=1))
