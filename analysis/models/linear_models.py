"""Linear models: matrices with named signals, and their modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Sampled poles nearer to z = 1 than this are neutral. Rounding of 1e-10 in a
#: matrix moves a double pole by its square root, 1e-5.
NEUTRAL = 1e-5
#: Poles nearer to z = 0 than this are delays, which have no s-plane image.
_DELAY = 1e-6
#: Elements of the matrices that are solved at once.
_CHUNK = 100_000


@dataclass(frozen=True)
class Mode:
    """One pole, or one of a conjugate pair with a positive frequency."""

    z: complex | None
    """Pole in the z plane; none in a continuous model."""
    eigenvalue: complex
    """Pole in the s plane, rad/s: ln(z)/T in a sampled model."""
    participation: dict[str, float]
    """Share of each state in the mode, largest first, of those above 1 %."""

    @property
    def frequency_rad_s(self) -> float:
        """Natural frequency |s|, rad/s."""
        return abs(self.eigenvalue)

    @property
    def damping_ratio(self) -> float:
        """-Re s / |s|; not a number for a pole at the origin."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size > 0.0 else math.nan

    @property
    def time_constant_s(self) -> float:
        """Time in which the mode falls to 1/e, s; negative where it grows."""
        rate = -self.eigenvalue.real
        return 1.0 / rate if rate != 0.0 else math.inf

    @property
    def settling_s(self) -> float:
        """Time to 2 %, s; infinite where the mode does not decay."""
        return 4.0 * self.time_constant_s if self.eigenvalue.real < 0.0 else math.inf


@dataclass(frozen=True)
class LinearModel:
    """x' = A x + B u, y = C x + D u; or x+ = ... where there is a period.

    All quantities are deviations from the operating point, in SI units.
    """

    name: str
    """What it is a model of."""
    A: NDArray[np.float64]
    """(n, n)"""
    B: NDArray[np.float64]
    """(n, m)"""
    C: NDArray[np.float64]
    """(p, n)"""
    D: NDArray[np.float64]
    """(p, m)"""
    state_names: tuple[str, ...]
    """n names."""
    input_names: tuple[str, ...]
    """m names."""
    output_names: tuple[str, ...]
    """p names."""
    period_s: float | None = None
    """Sample period, s; none where time is continuous."""

    def to_control(self) -> Any:
        """The same as ``control.StateSpace`` with named signals."""
        import control

        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            dt=self.period_s or 0,
            inputs=list(self.input_names),
            outputs=list(self.output_names),
            states=[name.replace(".", "_") for name in self.state_names],
            name=self.name.replace(" ", "_"),
        )

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """(n,) eigenvalues of A: s plane, or z plane where there is a period."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The eigenvalue table, slowest first, without pure delays (z = 0)."""
        from scipy.linalg import eig

        values, left, right = eig(self.A, left=True, right=True)
        shares = np.abs(left * right)
        modes = []
        for value, share in zip(values.astype(complex), shares.T, strict=True):
            if value.imag < 0.0 or (self.period_s and abs(value) < _DELAY):
                continue
            s = complex(np.log(value)) / self.period_s if self.period_s else value
            modes.append(
                Mode(value if self.period_s else None, s, self._participation(share))
            )
        return tuple(sorted(modes, key=lambda mode: -mode.eigenvalue.real))

    def _participation(self, share: NDArray[np.float64]) -> dict[str, float]:
        share = share / share.sum()
        order = np.argsort(-share)
        return {self.state_names[k]: float(share[k]) for k in order if share[k] > 0.01}

    def response(self, omega: Sequence[float] | NDArray[np.float64]) -> Any:
        """(p, m, k) complex frequency response at ``omega`` in rad/s."""
        omega = np.asarray(omega, dtype=float)
        points = np.exp(1j * omega * self.period_s) if self.period_s else 1j * omega
        eye, many = np.eye(len(self.A)), max(1, _CHUNK // max(len(self.A), 1) ** 2)
        rows = [
            self.C @ np.linalg.solve(z[:, None, None] * eye - self.A, self.B)
            for z in np.split(points, range(many, len(points), many))
        ]
        return np.moveaxis(np.concatenate(rows), 0, -1) + self.D[:, :, None]

    def part(self, inputs: Sequence[str], outputs: Sequence[str]) -> LinearModel:
        """The same with some of its inputs and outputs.

        Args:
            inputs: Names of inputs, in the order that is wanted.
            outputs: Names of outputs, in the order that is wanted.

        Returns:
            With all of its states.
        """
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


def simple_poles(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The poles that are neither zero nor within 1e-4 of another one.

    Others move by the root of a perturbation of the matrix: two computations
    that agree to rounding need not agree in them.

    Args:
        poles: (n,) in the z plane.

    Returns:
        (k,) of them, in their order.
    """
    distances = np.abs(poles[:, None] - poles[None, :])
    np.fill_diagonal(distances, np.inf)
    alone = (distances.min(axis=1) > 1e-4) & (np.abs(poles) > 1e-3)
    return poles[alone]
