"""Linear models as matrices with named signals, their modes, and their reduction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: A sampled pole nearer to z = 1 than this counts as neutral. A rounding error of
#: 1e-10 in a matrix moves a double pole by the square root of this error, 1e-5.
NEUTRAL = 1e-5
#: A pole nearer to z = 0 than this counts as a delay, which has no pole in the s plane.
DELAY = 1e-6
#: Largest number of matrix elements in one call of the solver.
_CHUNK = 100_000
#: If the part of a unit vector outside a subspace is shorter than this, the part counts
#: as a rounding error.
_NEGLIGIBLE = 1e-9


@dataclass(frozen=True)
class Mode:
    """Mode of a linear model: one real pole, or a conjugate pair of poles.

    For a pair, the fields describe the pole with the positive imaginary part.
    """

    z: complex | None
    """Pole in the z plane. In a continuous model: None."""
    eigenvalue: complex
    """Pole in the s plane, rad/s. In a sampled model: ln(z)/T."""
    participation: dict[str, float]
    """Share of each state in the mode, by name of the state, largest first. Shares of
    1 % and less are left out."""

    @property
    def frequency_rad_s(self) -> float:
        """Natural frequency |s|, rad/s."""
        return abs(self.eigenvalue)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio -Re s / |s|; NaN for a pole at the origin."""
        return damping_ratio(self.eigenvalue) if self.eigenvalue else math.nan

    @property
    def time_constant_s(self) -> float:
        """Time in which the mode decays to 1/e, s; negative for a growing mode."""
        rate = -self.eigenvalue.real
        return 1.0 / rate if rate != 0.0 else math.inf

    @property
    def settling_s(self) -> float:
        """Time in which the mode decays to 2 %, s; infinite if it does not decay."""
        return 4.0 * self.time_constant_s if self.eigenvalue.real < 0.0 else math.inf


@dataclass(frozen=True)
class LinearModel:
    """Linear state-space model in continuous or sampled time, with named signals.

    Continuous time: x' = A x + B u, y = C x + D u. Sampled time, if ``period_s`` is
    set: x+ = A x + B u, y = C x + D u. All quantities are deviations from the operating
    point, in SI units. With n states, m inputs and p outputs, A is (n, n), B (n, m),
    C (p, n) and D (p, m).
    """

    name: str
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    period_s: float | None = None
    """Sample period, s. In continuous time: None."""

    def to_control(self) -> Any:
        """Returns the model as a ``control.StateSpace`` with named signals.

        ``control`` permits no periods in names. They become underscores.
        """
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            dt=self.period_s or 0,
            inputs=[name.replace(".", "_") for name in self.input_names],
            outputs=[name.replace(".", "_") for name in self.output_names],
            states=[name.replace(".", "_") for name in self.state_names],
            name=self.name.replace(" ", "_"),
        )

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """(n,) eigenvalues of A, in the z plane (sampled) or s plane (continuous)."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @property
    def s_poles(self) -> NDArray[np.complex128]:
        """(k,) poles in the s plane, rad/s, without pure delays (z = 0)."""
        return s_plane(self.poles, self.period_s)

    @property
    def spectral_radius(self) -> float:
        """Largest |z| of a sampled model; 0 without states."""
        return float(np.abs(self.poles).max(initial=0.0))

    @property
    def growth_per_s(self) -> float:
        """Largest growth rate of all modes, 1/s; -infinity if all poles are delays.

        The rate is negative if all modes decay.
        """
        if self.period_s:
            return float(growth_per_s(self.spectral_radius, self.period_s))
        return float(self.poles.real.max(initial=-math.inf))

    @property
    def stable(self) -> bool:
        """Whether all modes decay."""
        if self.period_s:
            return self.spectral_radius < 1.0
        return self.growth_per_s < 0.0

    @property
    def damping_ratio(self) -> float:
        """Smallest damping ratio of all modes; 1 if no mode oscillates or grows."""
        return float(damping_ratio(self.s_poles).min(initial=1.0))

    @property
    def settling_s(self) -> float:
        """Time in which the slowest mode decays to 2 %, s; infinite without decay."""
        growth = self.growth_per_s
        return -4.0 / growth if growth < 0.0 else math.inf

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """Modes of the model without pure delays (z = 0), the slowest decay first."""
        from scipy.linalg import eig

        values, left, right = eig(self.A, left=True, right=True)
        shares = np.abs(left * right)
        modes = []
        for value, share in zip(values.astype(complex), shares.T, strict=True):
            poles = s_plane(np.array([value]), self.period_s)
            if value.imag < 0.0 or not len(poles):
                continue
            z = value if self.period_s else None
            modes.append(Mode(z, complex(poles[0]), self._participation(share)))
        return tuple(sorted(modes, key=lambda mode: -mode.eigenvalue.real))

    def _participation(self, share: NDArray[np.float64]) -> dict[str, float]:
        share = share / share.sum()
        order = np.argsort(-share)
        return {self.state_names[k]: float(share[k]) for k in order if share[k] > 0.01}

    def response(self, omega: Sequence[float] | NDArray[np.float64]) -> Any:
        """(p, m, k) complex frequency response at k frequencies ``omega``, rad/s."""
        omega = np.asarray(omega, dtype=float)
        points = np.exp(1j * omega * self.period_s) if self.period_s else 1j * omega
        eye, many = np.eye(len(self.A)), max(1, _CHUNK // max(len(self.A), 1) ** 2)
        rows = [
            self.C @ np.linalg.solve(z[:, None, None] * eye - self.A, self.B)
            for z in np.split(points, range(many, len(points), many))
        ]
        return np.moveaxis(np.concatenate(rows), 0, -1) + self.D[:, :, None]

    def part(self, inputs: Sequence[str], outputs: Sequence[str]) -> LinearModel:
        """Returns the model with only the named inputs and outputs, in this order."""
        columns = [self.input_names.index(name) for name in inputs]
        rows = [self.output_names.index(name) for name in outputs]
        return replace(
            self,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[np.ix_(rows, columns)],
            input_names=tuple(inputs),
            output_names=tuple(outputs),
        )


def s_plane(
    poles: NDArray[np.complex128], period_s: float | None
) -> NDArray[np.complex128]:
    """Returns poles in the s plane, rad/s, without pure delays (z = 0).

    If ``period_s`` is a number T, ``poles`` are in the z plane and become ln(z)/T. If
    it is None, ``poles`` are already in the s plane and stay the same.
    """
    poles = np.asarray(poles, dtype=np.complex128)
    if not period_s:
        return poles
    return np.asarray(np.log(poles[np.abs(poles) > DELAY]) / period_s)


def growth_per_s(radius: ArrayLike, period_s: ArrayLike) -> Any:
    """Returns ln(radius)/T, the growth rate of a mode with |z| = ``radius``, 1/s."""
    with np.errstate(divide="ignore"):
        return np.log(radius) / period_s


def damping_ratio(s: Any) -> Any:
    """Returns the damping ratio -Re s/|s| of nonzero poles s in the s plane.

    It is negative for growing modes.
    """
    return -np.real(s) / np.abs(s)


def simple_poles(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Returns the poles z that are neither near zero nor within 1e-4 of another pole.

    A small change e of a matrix can move a double pole by about sqrt(e). Two
    computations whose matrices agree up to rounding can therefore differ noticeably in
    their multiple poles.
    """
    distances = np.abs(poles[:, None] - poles[None, :])
    np.fill_diagonal(distances, np.inf)
    alone = (distances.min(axis=1) > 1e-4) & (np.abs(poles) > 1e-3)
    return poles[alone]


def minimal_model(model: LinearModel) -> LinearModel:
    """Returns the controllable and observable part of a model.

    The frequency response stays the same. The closed loop has many states outside this
    part: the error of odometry, the angles of the wheels, and the covariances of the
    tracker. Their poles are at z = 1 or z = 0, and make transfer polynomials
    ill-conditioned. The remaining states are orthonormal combinations of the states of
    ``model``.
    """
    moved = _on(model, _span(model.A, model.B))
    return _on(moved, _span(moved.A.T, moved.C.T))


def _span(A: NDArray[np.float64], B: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, k) orthonormal basis of the controllable subspace of A and B."""
    basis = np.empty((len(A), 0))
    waiting = list(B.T)
    while waiting:
        vector = waiting.pop(0)
        size = np.linalg.norm(vector)
        if size == 0.0:
            continue
        vector = vector / size
        for _ in range(2):  # the second time removes rounding errors of the first
            vector = vector - basis @ (basis.T @ vector)
        size = np.linalg.norm(vector)
        if size > _NEGLIGIBLE:
            vector = vector / size
            basis = np.column_stack([basis, vector])
            waiting.append(A @ vector)
    return basis


def _on(model: LinearModel, basis: NDArray[np.float64]) -> LinearModel:
    return replace(
        model,
        A=basis.T @ model.A @ basis,
        B=basis.T @ model.B,
        C=model.C @ basis,
        state_names=tuple(f"combination_{k}" for k in range(basis.shape[1])),
    )
