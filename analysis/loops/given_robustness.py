"""Robust stability of a family of loops that a user gives."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import System

from analysis.loops.diagram_linearization import linearize
from analysis.loops.given_box import box_ends, named
from analysis.loops.given_loops import as_linear_model
from analysis.loops.growth_bound import MOST_PARTS, Family, GrowthBound, bound_growth
from analysis.loops.stable_scale import StableScale, stable_scale
from analysis.report.plain_values import pick, plain
from systems.framework.input_error import InputError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Robustness:
    """Stability of all loops of a family, from both sides."""

    growth_per_s: float
    """Largest growth rate that was found, 1/s: ln|z|/T of the poles z of a sampled
    loop, or Re s. The loops that were tried are stable if it is negative."""
    proven_growth_per_s: float
    """Growth rate that no loop of the family exceeds, 1/s. All loops are proven stable
    if it is negative. Infinite if nothing was proven."""
    worst_values: dict[str, float]
    """Parameters of the worst loop that was found."""
    scale_proven: float
    """The box may grow by this factor about the nominal parameters, and all loops are
    still proven stable."""
    scale_unstable: float
    """Smallest factor for which an unstable loop was found; infinite if none was."""
    scale_largest: float
    """Largest factor that was examined."""
    parts: int
    """Number of parts of the box and of the frequencies in the proof of
    ``proven_growth_per_s``."""
    fit_error: float
    """Assumed error of the polynomials that replace the dependence on the parameters,
    as a share of the largest coefficient. The proof allows for this error."""
    computing_time_s: float

    @property
    def verdict(self) -> Literal["stable", "unstable", "undecided"]:
        """Whether all loops are proven stable, or an unstable one was found."""
        if self.proven_growth_per_s < 0.0:
            return "stable"
        return "unstable" if self.growth_per_s > 0.0 else "undecided"

    @property
    def gap(self) -> float:
        """Difference of both growth rates, as a share of the one that was found."""
        difference = self.proven_growth_per_s - self.growth_per_s
        return difference / abs(self.growth_per_s) if self.growth_per_s else math.inf

    def document(self) -> dict[str, Any]:
        """Returns the values for a JSON document; infinity becomes None."""
        names = [each.name for each in fields(self)]
        found: dict[str, Any] = plain(pick(self, "verdict", "gap", *names))
        return found

    def __str__(self) -> str:
        values = ", ".join(f"{k} = {v:.6g}" for k, v in self.worst_values.items())
        unstable = (
            "no unstable loop found"
            if math.isinf(self.scale_unstable)
            else f"unstable at {self.scale_unstable:.5g}"
        )
        growth, proven = self.growth_per_s, self.proven_growth_per_s
        gap, stable = 100.0 * self.gap, self.scale_proven
        return f"""{self.verdict}
largest growth rate: {growth:.6g} 1/s found, at most {proven:.6g} 1/s (gap {gap:.2g} %)
worst case found: {values}
scale of the box: proven stable up to {stable:.5g}, {unstable} (tried up to \
{self.scale_largest:.4g})
{self.parts} parts, {self.computing_time_s:.2f} s, error of the polynomials \
{self.fit_error:.1e}"""


def robustness(
    model_of: Callable[[dict[str, float]], Any],
    box: Mapping[str, Sequence[float]],
    *,
    period_s: float | None = None,
    most_parts: int = MOST_PARTS,
) -> Robustness:
    """Bounds the stability of a closed loop over a box of uncertain parameters.

    The characteristic polynomial is fitted by polynomials of the parameters or of
    their reciprocals. The zero exclusion principle with Bernstein coefficients then
    proves a growth rate that no loop of the box exceeds (Barmish 1994; Garloff 1993).
    The proof assumes that the error of the fit is nowhere larger than ten times the
    largest error at 40 random points. For a matrix whose elements are polynomials or
    reciprocals of each parameter, this error is that of rounding.

    Args:
        model_of: Returns the closed loop for parameters by name: an (n, n) matrix A, a
            ``control.StateSpace`` or ``control.TransferFunction``, the result of
            ``linearize``, or a Drake ``Diagram``, alone or as (diagram, context). The
            number of states must not depend on the parameters.
        box: Interval of each parameter: (low, high), or (low, nominal, high). Without
            a nominal value, the middle is nominal.
        period_s: Sample period of a matrix, s. None: continuous time. A model has its
            own period.
        most_parts: Largest number of parts into which one proof divides the box.

    Returns:
        Growth rates and scales, found and proven.

    Raises:
        InputError: The box is empty or not in order, or the matrix is not a smooth
            function of the parameters.
    """
    start = time.perf_counter()
    names = list(box)
    low, nominal, high = box_ends(box)
    first = _as_matrix(model_of(named(names, nominal)), period_s)
    period = first[1]

    def matrix_of(values: Vector) -> NDArray[np.float64]:
        matrix, own = _as_matrix(model_of(named(names, values)), period_s)
        if matrix.shape != first[0].shape or own != period:
            raise InputError(
                "model_of",
                "the number of states or the period depends on the parameters; analyze "
                "each case alone",
            )
        return matrix

    bound = bound_growth(Family(matrix_of, period, low, high), most_parts)
    scale = stable_scale(
        lambda *ends: [Family(matrix_of, period, *ends)], low, nominal, high
    )
    return _result(names, bound, scale, time.perf_counter() - start)


def _result(
    names: list[str], bound: GrowthBound, scale: StableScale, seconds: float
) -> Robustness:
    return Robustness(
        growth_per_s=bound.found_per_s,
        proven_growth_per_s=bound.proven_per_s,
        worst_values=named(names, bound.worst),
        scale_proven=scale.proven,
        scale_unstable=scale.unstable,
        scale_largest=scale.largest,
        parts=bound.parts,
        fit_error=bound.fit_error,
        computing_time_s=seconds,
    )


def _as_matrix(
    model: Any, period_s: float | None
) -> tuple[NDArray[np.float64], float | None]:
    """Returns the matrix A and the period of a model of any accepted type, s."""
    diagram, context = model if _is_placed(model) else (model, None)
    if isinstance(diagram, System):
        model = linearize(diagram, context, inputs=(), outputs=())
    if isinstance(model, np.ndarray | list | tuple):
        matrix = np.asarray(model, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise InputError(
                "model_of",
                f"returns an array of shape {matrix.shape}; return a square matrix",
            )
        return matrix, period_s
    linear = as_linear_model(model)
    return linear.A, linear.period_s


def _is_placed(model: Any) -> bool:
    """Whether a model is a diagram with its context."""
    return isinstance(model, tuple) and len(model) == 2 and isinstance(model[0], System)
