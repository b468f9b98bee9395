"""Search for the frequencies at which a frequency response reaches a level.

A frequency grid alone misses what happens between two of its points. For example, the
peak of a mode with a damping ratio of 1e-3 is only a thousandth of its frequency wide.
In this module, the response G reaches a level at the frequencies that satisfy

    a |G|^2 + 2 Re(b G) + c = 0

on the border of stability (s = j omega, or z = exp(j omega T)), with real a and c. The
left side equals a rational function of s or z. The zeros of this function are the
eigenvalues of a matrix pencil with twice the order of G. In continuous time, this is
the Hamiltonian pencil of Boyd, Balakrishnan and Kabamba (1989). In sampled time, it is
the symplectic pencil. The zeros on the border of stability give the wanted frequencies.

The eigenvalues have rounding errors and only show *where to look*. Callers therefore
evaluate G at these frequencies and between them, and refine the result.

Sources: Boyd, Balakrishnan and Kabamba, "A bisection method for computing the
H-infinity norm", Math. Control Signals Systems 2 (1989); Bruinsma and Steinbuch, "A
fast algorithm to compute the H-infinity norm", Systems & Control Letters 14 (1990).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance
from scipy.optimize import brentq, minimize_scalar

from analysis.loops.linear_models import LinearModel, s_plane

#: Number of points of a frequency grid. First: for figures. Second: for the first grid
#: of a search.
GRID_POINTS, SEARCH_POINTS = 1500, 100
#: Number of additional points near the Nyquist frequency of a sampled response, as a
#: share of the number of points of the grid.
_CLOSE = 0.2
#: The grid reaches at least from the first to the second frequency, rad/s. In sampled
#: time, the grid ends at the Nyquist frequency.
_LOWEST, _HIGHEST = 1e-3, 1e3
#: Offsets of grid points from the frequency of a mode, in units of its decay rate.
_ABOUT = np.array([0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
#: Poles below this share of the fastest one count as integrators in the grid.
_INTEGRATOR = 1e-7
#: Smallest ratio of two neighboring shifts. A shift is a frequency near which the
#: eigenvalues of the pencil are computed accurately.
_SHIFT_RATIO = 30.0
#: Relative accuracy of a peak.
_PEAK = 1e-9
#: Largest number of rounds in the search for a peak. Two or three usually suffice. Only
#: rounding errors could require more.
_ROUNDS = 20


def frequency_grid(
    poles: NDArray[np.complex128],
    period_s: float | None,
    *,
    lowest: float = _LOWEST,
    points: int = GRID_POINTS,
) -> NDArray[np.float64]:
    """Returns (k,) ascending frequencies that resolve every mode, rad/s.

    ``poles`` are in the z plane. In continuous time, ``period_s`` is None, and they are
    in the s plane. The grid begins at ``lowest``, rad/s, or below the slowest mode. It
    ends at the Nyquist frequency, or in continuous time beyond the fastest mode. It has
    ``points`` on a logarithmic scale, and additional points near the modes.
    """
    s = s_plane(poles, period_s)
    size = np.abs(s)
    moving = size[size > _INTEGRATOR * size.max(initial=0.0)]
    low = min(lowest, 0.1 * moving.min(initial=np.inf))
    high = (
        math.pi / period_s if period_s else max(_HIGHEST, 10.0 * moving.max(initial=0))
    )
    parts = [np.geomspace(low, high, points)]
    if period_s:
        # Zeros near z = -1 change the phase close to the Nyquist frequency.
        parts.append(high * (1.0 - np.geomspace(1e-2, 1e-7, round(_CLOSE * points))))
    middle, width = np.abs(s.imag)[:, None], np.abs(s.real)[:, None]
    parts += [(middle + width * _ABOUT).ravel(), (middle - width * _ABOUT).ravel()]
    omega = np.unique(np.concatenate(parts))
    omega = omega[(omega >= low) & (omega <= high)]
    # On an undamped pole the response is infinite.
    apart = np.abs(1j * omega[:, None] - s).min(axis=1, initial=np.inf)
    return np.asarray(omega[apart > 1e-13 * omega])


def level_frequencies(
    model: LinearModel, a: float, b: complex, c: float
) -> NDArray[np.float64]:
    """Returns frequencies at which a |G|^2 + 2 Re(b G) + c may be zero.

    G is the response of ``model``, which has one input, one output, and no poles on the
    border of stability. With b = 1, the second term is twice the real part of G. With
    b = -1j, it is twice the imaginary part. The (k,) ascending frequencies, rad/s, are
    above 0 and below the Nyquist frequency. They contain all zeros of the expression,
    up to rounding errors, and also frequencies that are not zeros.
    """
    n, T = len(model.A), model.period_s
    if n == 0:
        return np.zeros(0)
    A, B, C = _balanced(model)
    D = float(model.D[0, 0])
    # Unknowns: the state x, the adjoint state q, and the input u.
    M = np.zeros((2 * n + 1, 2 * n + 1), dtype=complex)
    N = np.zeros_like(M)
    drive = a * D + b
    M[:n, :n], M[:n, -1:] = A, B
    M[n:-1, :n], M[n:-1, -1:] = a * C.T @ C, C.T * drive
    M[-1, :n] = C[0] * np.conj(drive)
    M[-1, -1] = a * D * D + 2.0 * (b * D).real + c
    N[:n, :n] = np.eye(n)
    if T:
        M[n:-1, n:-1], N[n:-1, n:-1] = -np.eye(n), -A.T
        N[-1, n:-1] = -B[:, 0]
    else:
        M[n:-1, n:-1], N[n:-1, n:-1] = A.T, -np.eye(n)
        M[-1, n:-1] = B[:, 0]
    found: list[NDArray[np.float64]] = []
    for omega in _shifts(model):
        at = np.exp(1j * omega * T) if T else 1j * omega
        try:
            inverse = np.linalg.solve(M - at * N, N)
        except np.linalg.LinAlgError:
            continue  # the expression is zero at the shift, or everywhere
        mu = np.linalg.eigvals(inverse)
        points = at + 1.0 / mu[np.abs(mu) > 1e-300]
        found.append(np.abs(np.angle(points) / T if T else points.imag))
        found.append(np.array([omega]))
    every = np.concatenate(found) if found else np.zeros(0)
    top = math.pi / T if T else math.inf
    return np.unique(every[(every > 0.0) & (every < top)])


def _balanced(model: LinearModel) -> tuple[NDArray[np.float64], ...]:
    """A, B and C with the states scaled to similar magnitudes."""
    n = len(model.A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n:], whole[n:, :n] = model.A, model.B, model.C
    scaled, _ = matrix_balance(whole, permute=False)
    return scaled[:n, :n], scaled[:n, n:], scaled[n:, :n]


def _shifts(model: LinearModel) -> list[float]:
    """Frequencies of some modes, rad/s, near which to compute accurate eigenvalues."""
    top = math.pi / model.period_s if model.period_s else math.inf
    size = np.sort(np.abs(model.s_poles))
    chosen: list[float] = []
    for omega in np.minimum(size[size > 0.0], 0.7 * top):
        if not chosen or omega > _SHIFT_RATIO * chosen[-1]:
            chosen.append(float(omega))
    return chosen or [min(1.0, 0.7 * top)]


def with_middles(omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the frequencies and the geometric means of neighbors, sorted."""
    omega = np.unique(omega)
    return np.sort(np.concatenate((omega, np.sqrt(omega[:-1] * omega[1:]))))


def crossings(
    omega: NDArray[np.float64],
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> list[float]:
    """Returns the ascending frequencies at which a function of frequency is zero.

    ``omega`` (n,) are ascending frequencies, rad/s. At least one of them must lie
    between any two zeros of the function. The result of ``with_middles``, applied to
    that of ``level_frequencies``, satisfies this condition.
    """
    values = np.sign(function(omega))
    exact = [float(w) for w in omega[values == 0.0]]
    steps = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    between = [
        float(
            brentq(
                lambda w: float(function(np.array([w]))[0]),
                omega[k],
                omega[k + 1],
                xtol=1e-300,
                rtol=1e-14,
            )
        )
        for k in steps
    ]
    return sorted(exact + between)


def peak(model: LinearModel, offset: float = 0.0) -> tuple[float, float]:
    """Returns the largest |G - offset| over all frequencies, and its frequency, rad/s.

    ``model`` is stable and has one input and one output. Its response is G. The first
    value is the H-infinity norm of G - offset. The method is that of Bruinsma and
    Steinbuch: the largest value so far is a level, and larger values are sought at the
    frequencies where |G - offset| crosses this level, and between them. The frequencies
    reach up to the Nyquist frequency, or to infinity in continuous time.
    """

    def size(omega: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.abs(model.response(omega)[0, 0] - offset))

    T = model.period_s
    omega = np.concatenate(
        ([0.0], frequency_grid(model.poles, T, points=SEARCH_POINTS))
    )
    values = size(omega)
    if not T:
        omega = np.append(omega, math.inf)
        values = np.append(values, abs(float(model.D[0, 0]) - offset))
    k = int(values.argmax())
    best, where = float(values[k]), float(omega[k])
    for _ in range(_ROUNDS):
        best, where = _refined(size, omega, k, best, where)
        level = best * (1.0 + _PEAK)
        if level == 0.0:
            break
        found = level_frequencies(model, 1.0, -offset, offset**2 - level**2)
        tried = with_middles(found)
        values = size(tried) if len(tried) else np.zeros(0)
        if values.max(initial=0.0) <= level:
            break
        omega, k = tried, int(values.argmax())
        best, where = float(values[k]), float(omega[k])
    return best, where


def _refined(
    size: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    omega: NDArray[np.float64],
    k: int,
    best: float,
    where: float,
) -> tuple[float, float]:
    """Value and frequency of the peak near the frequency with index ``k``."""
    low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
    if not low < high < math.inf:
        return best, where
    found = minimize_scalar(
        lambda w: -float(size(np.array([w]))[0]),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-9 * high},
    )
    return (-found.fun, float(found.x)) if -found.fun > best else (best, where)
