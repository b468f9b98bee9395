"""Disk margins of several loops that change at the same time.

Each signal i between the loops is multiplied by a factor

    f_i = (1 + (1 - skew)/2 d_i) / (1 - (1 + skew)/2 d_i)

with a complex |d_i| < alpha. The disk margin is the largest alpha for which the closed
loop stays stable with all such factors. It is 1 / sup mu(S + (skew - 1)/2 I), where S =
(I + L)^-1 and mu is the structured singular value for diagonal complex d (Seiler,
Packard and Gahinet 2020, section "Multi-loop disk margins").

mu is bounded from above by the scaled largest singular value, which equals mu for up to
three loops (Doyle 1982; Packard and Doyle 1993), and from below by a change that makes
the loop unstable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from analysis.loops.frequency_levels import frequency_grid
from analysis.loops.linear_models import LinearModel
from analysis.loops.margin_results import DiskMargin
from analysis.loops.response_margins import nyquist_stable, refuse_gaps
from systems.framework.input_error import InputError

#: Number of frequencies at which mu is computed first.
_POINTS = 300
#: Number of the highest points of the grid around which the peak is refined.
_PEAKS = 3
#: Number of starts of the search for a destabilizing change.
_STARTS = 8


@dataclass(frozen=True)
class MultiloopDiskMargin(DiskMargin):
    """Disk margin of several loops that change at the same time.

    ``alpha`` is the size of the disk for which stability is guaranteed.
    """

    destabilizing_alpha: float = math.inf
    """Size of a disk that contains a destabilizing change. For up to three loops, it
    equals ``alpha`` up to rounding errors."""

    def to_dict(self) -> dict[str, float]:
        """Values for the JSON document."""
        return {**super().to_dict(), "destabilizing_alpha": self.destabilizing_alpha}


def multiloop_disk_margin(model: LinearModel, skew: float = 0.0) -> MultiloopDiskMargin:
    """Computes the disk margin of a loop L with n inputs and n outputs.

    The feedback is negative: output i goes back to input i with a factor of -f_i.

    Args:
        model: Loop transfer function L, continuous or sampled.
        skew: Skew of the disk, -1 to 1. With 0, gain increase and gain reduction count
            alike.

    Returns:
        The disk margin. If the closed loop itself is unstable, ``alpha`` is 0.

    Raises:
        InputError: L does not have as many outputs as inputs.
    """
    n = model.B.shape[1]
    if model.C.shape[0] != n or n == 0:
        raise _not_square(model.name, n, model.C.shape[0])
    sensitivity = _sensitivity(model)
    if not sensitivity.stable:
        return MultiloopDiskMargin(skew, 0.0, math.nan, 0.0)
    offset = (skew - 1.0) / 2.0 * np.eye(n)
    T = sensitivity.period_s
    poles = np.concatenate([model.poles, sensitivity.poles])
    omega = np.concatenate([[0.0], frequency_grid(poles, T, points=_POINTS)])

    def at(w: float) -> NDArray[np.complex128]:
        return np.asarray(sensitivity.response([w])[:, :, 0] + offset)

    matrices = np.moveaxis(sensitivity.response(omega), -1, 0) + offset
    peaks = _peaks(matrices)
    best, where = peaks[0][0], float(omega[peaks[0][1]])
    for _, k in peaks[:_PEAKS]:
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
        found = minimize_scalar(
            lambda w: -mu_upper(at(float(w))),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-6 * max(high, 1e-9)},
        )
        if -found.fun > best:
            best, where = float(-found.fun), float(found.x)
    highest: NDArray[np.complex128] = (sensitivity.D + offset).astype(complex)
    # In continuous time, S is (I + D)^-1 at infinite frequency.
    if not T and (last := mu_upper(highest)) > best:
        best, where = last, math.inf
    lower = mu_lower(highest if where == math.inf else at(where))
    return _margin(skew, best, where, lower)


def samples_disk_margin(
    omega: NDArray[np.float64],
    L: NDArray[np.complex128],
    skew: float,
    unstable_poles: int,
) -> MultiloopDiskMargin:
    """Computes the disk margin of several loops at the frequencies of a response.

    The closed loop is stable if det(I + L) turns about 0 as the Nyquist criterion asks.

    Args:
        omega: (k,) ascending frequencies, rad/s.
        L: (n, n, k) values of L.
        skew: Skew of the disk, -1 to 1.
        unstable_poles: Number of growing poles of L.

    Returns:
        The disk margin, as of ``multiloop_disk_margin``.

    Raises:
        InputError: L is not square, or does not decide whether the loop is stable.
    """
    n = len(L)
    if L.shape[1] != n:
        raise _not_square("loop", L.shape[1], n)
    back = np.eye(n) + np.moveaxis(L, -1, 0)
    turning = np.linalg.det(back)
    refuse_gaps(omega, turning)
    if not nyquist_stable(omega, turning - 1.0, unstable_poles):
        return MultiloopDiskMargin(skew, 0.0, math.nan, 0.0)
    matrices = np.asarray(np.linalg.inv(back) + (skew - 1.0) / 2.0 * np.eye(n), complex)
    (best, k), *_ = _peaks(matrices)
    return _margin(skew, best, float(omega[k]), mu_lower(matrices[k]))


def _peaks(matrices: NDArray[np.complex128]) -> list[tuple[float, int]]:
    """Largest bounds of mu with their positions, in falling order.

    A quick bound shows at which frequencies the best scaling can matter.
    """
    quick = np.array([_balanced(M)[0] for M in matrices])
    best, peaks = -1.0, []
    for k in np.argsort(-quick):
        if quick[k] <= best:
            break
        value = mu_upper(matrices[k])
        peaks.append((value, int(k)))
        best = max(best, value)
    return sorted(peaks, reverse=True)


def _margin(
    skew: float, best: float, where: float, lower: float
) -> MultiloopDiskMargin:
    """Disk margin from the bounds of mu and the frequency of the upper one."""
    return MultiloopDiskMargin(
        skew,
        1.0 / best if best > 0.0 else math.inf,
        where,
        1.0 / lower if lower > 0.0 else math.inf,
    )


def _not_square(name: str, inputs: int, outputs: int) -> InputError:
    return InputError(
        name,
        f"has {inputs} inputs and {outputs} outputs; a multi-loop margin needs as many "
        "outputs as inputs",
    )


def _sensitivity(model: LinearModel) -> LinearModel:
    """S = (I + L)^-1. If the closed loop is stable, all poles of S decay."""
    inverse = np.asarray(np.linalg.inv(np.eye(len(model.D)) + model.D), dtype=float)
    return replace(
        model,
        A=model.A - model.B @ inverse @ model.C,
        B=model.B @ inverse,
        C=-inverse @ model.C,
        D=inverse,
    )


def mu_upper(M: NDArray[np.complex128]) -> float:
    """Bounds the structured singular value for diagonal complex changes from above.

    The bound is the smallest largest singular value of D M D^-1 over positive diagonal
    D. Its logarithm is convex in the logarithms of the diagonal.

    Args:
        M: (n, n) matrix.

    Returns:
        The bound, which is exact for n <= 3.
    """
    if len(M) == 1:
        return float(abs(M[0, 0]))
    bound, start = _balanced(M)
    if len(M) == 2:
        found = minimize_scalar(
            lambda x: _scaled(M, np.array([x]))[0],
            bounds=(start[0] - 3.0, start[0] + 3.0),
            method="bounded",
            options={"xatol": 1e-9},
        )
        return min(bound, float(found.fun))
    smooth = minimize(
        lambda x: _scaled(M, x), start, jac=True, method="BFGS", options={"gtol": 1e-9}
    )
    # Where two singular values are equal, the bound has a corner.
    again = minimize(
        lambda x: _scaled(M, x)[0],
        smooth.x,
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-12, "maxiter": 200 * len(M)},
    )
    return min(bound, float(smooth.fun), float(again.fun))


def _scaled(
    M: NDArray[np.complex128], logs: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Largest singular value of D M D^-1, and its derivative by ``logs``.

    The diagonal of D is the exponential of ``logs``, and 1 as its last element.
    """
    scale = np.exp(np.append(logs, 0.0))
    U, s, Vh = np.linalg.svd(scale[:, None] * M / scale)
    slope = s[0] * (np.abs(U[:, 0]) ** 2 - np.abs(Vh[0]) ** 2)
    return float(s[0]), slope[:-1]


def _balanced(M: NDArray[np.complex128]) -> tuple[float, NDArray[np.float64]]:
    """Bound and scaling (n - 1,) for equal norms of rows and columns (Osborne 1960)."""
    n = len(M)
    squared = np.abs(M) ** 2
    np.fill_diagonal(squared, 0.0)
    logs = np.zeros(n)
    for _ in range(10):
        for k in range(n):
            scale = np.exp(2.0 * logs)
            row, column = (
                scale[k] * (squared[k] / scale).sum(),
                (squared[:, k] * scale).sum() / scale[k],
            )
            if row > 0.0 and column > 0.0:
                logs[k] += 0.25 * math.log(column / row)
    start = (logs - logs[-1])[:-1]
    return _scaled(M, start)[0], start


def mu_lower(M: NDArray[np.complex128]) -> float:
    """Bounds the structured singular value for diagonal complex changes from below.

    The bound is the largest spectral radius of M U that the search finds over diagonal
    U with elements of size 1.

    Args:
        M: (n, n) matrix.

    Returns:
        The bound.
    """
    n = len(M)

    def radius(phases: NDArray[np.float64]) -> float:
        turned = M * np.exp(1j * np.append(phases, 0.0))
        return -float(np.abs(np.linalg.eigvals(turned)).max())

    if n == 1:
        return float(abs(M[0, 0]))
    starts = np.linspace(0.0, math.tau, _STARTS, endpoint=False)
    return max(
        -float(
            minimize(
                radius,
                start * np.arange(1, n),
                method="Nelder-Mead",
                options={"xatol": 1e-9, "fatol": 1e-13},
            ).fun
        )
        for start in starts
    )
