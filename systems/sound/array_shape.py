"""Shape of a microphone array: what it spans, and what it cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.input_error import InputError

# Nearer than this, two microphones are one, m.
_LEAST_DISTANCE_M = 1e-3

# Off a line or a plane by less than this share of the aperture is on it.
_FLATNESS = 0.01

_UPRIGHT = ("above", "below")


class EqualRow(NamedTuple):
    """Three microphones M1, M2, M3 from left to right for one who looks ahead."""

    spacing_m: float
    """Distance between neighbours, m."""
    to_delays: NDArray[np.float64]
    """(2, 2) tau_12 and tau_13 from the delays t_k - t_0 in the array's order."""
    axes: NDArray[np.float64]
    """(d, 2) ahead and left, unit vectors as columns."""


@dataclass(frozen=True)
class ArrayShape:
    """Microphones about their centroid, in the array's frame A.

    A has the axes in which the positions were given, and its origin at their
    centroid. Make one by ``ArrayShape.of``.
    """

    p_AM: NDArray[np.float64]
    """(n, d) microphones, m; d is 2 or 3."""
    kind: Literal["row", "plane", "space"]
    """What the microphones span: a line, a plane, or space."""
    span: NDArray[np.float64]
    """(r, d) orthonormal vectors of A that span it. A row's points to the left
    of one who looks along ``ahead``."""
    ahead: NDArray[np.float64] | None
    """(d,) unit vector off the line or plane, to the side that is reported:
    towards +x, or +y for a row along x; towards +z for a plane in space, or as
    a row's where that plane is upright. None where nothing is ambiguous."""
    aperture_m: float
    """Largest distance between two microphones, m."""
    side: Literal["ahead", "behind", "above", "below"] | None = None
    """Where all sources are known to be; None: on either side."""

    @classmethod
    def of(cls, positions: ArrayLike, flat_m: float | None = None) -> ArrayShape:
        """The shape of some microphones.

        Args:
            positions: (n, 2) or (n, 3) places in any frame, m; n at least 3.
            flat_m: How far microphones may stand off a line or a plane that
                counts as one, m. None: 1 % of the aperture.

        Returns:
            The microphones about their centroid, and what they span.

        Raises:
            InputError: Too few, coincident or unreadable positions.
        """
        p = np.array(positions, dtype=np.float64)
        if p.ndim != 2 or p.shape[1] not in (2, 3):
            raise InputError(
                "microphones",
                f"positions have the shape {p.shape}; give (x, y) or (x, y, z) "
                "of each microphone",
            )
        _check(p)
        p -= p.mean(axis=0)
        aperture = float(_distances(p).max())
        limit = _FLATNESS * aperture if flat_m is None else flat_m
        axes = np.linalg.svd(p, full_matrices=True)[2]
        # A row: all distances from the longest axis; a plane: from the first two.
        if np.linalg.norm(p @ axes[1:].T, axis=1).max() <= limit:
            ahead, left = _row_axes(axes[0])
            return cls(p, "row", left[np.newaxis], ahead, aperture)
        if p.shape[1] == 2:
            return cls(p, "plane", np.eye(2), None, aperture)
        if np.abs(p @ axes[2]).max() <= limit:
            return cls(p, "plane", axes[:2], _upward(axes[2]), aperture)
        return cls(p, "space", np.eye(3), None, aperture)

    @property
    def count(self) -> int:
        """Number n of microphones."""
        return len(self.p_AM)

    @property
    def dimension(self) -> int:
        """Number d of coordinates: 2 or 3."""
        return self.p_AM.shape[1]

    @property
    def ambiguity(self) -> Literal["none", "front_back", "mirror"]:
        """What fits the same delays: front and back, the mirror image, nothing.

        A row in space cannot even tell front from above: every place on a
        circle about it fits.
        """
        if self.ahead is None or self.side is not None:
            return "none"
        return "front_back" if self.kind == "row" else "mirror"

    @property
    def unknowns(self) -> int:
        """What delays can tell at most: angles, and the range."""
        return len(self.span) + (self.ahead is not None)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the delays' residuals; none if not positive."""
        return self.count - 1 - self.unknowns

    @cached_property
    def angles(self) -> tuple[Literal["bearing", "elevation"], ...]:
        """What of a direction delays can tell.

        With a slanted row it is neither: the angle with the row is known, but no
        azimuth and no elevation.
        """
        if self.dimension == 2:
            return ("bearing",)
        if self.kind != "row":
            return ("bearing", "elevation")
        rise = abs(self.span[0, 2])
        if rise < _FLATNESS:
            return ("bearing",)
        return ("elevation",) if rise > 1.0 - _FLATNESS**2 else ()

    @cached_property
    def pairs(self) -> NDArray[np.int64]:
        """(n (n - 1) / 2, 2) all pairs of microphones i < j."""
        return np.stack(np.triu_indices(self.count, 1), axis=1)

    @cached_property
    def distances_m(self) -> NDArray[np.float64]:
        """Distance of each of ``pairs``, m."""
        return _distances(self.p_AM)[tuple(self.pairs.T)]

    def facing(self, side: Literal["ahead", "behind", "above", "below"]) -> ArrayShape:
        """The same microphones where all sources are known to be on one side.

        Args:
            side: Ahead is towards +x, or +y for a row along x; above towards +z.

        Returns:
            The shape that looks there; ``ambiguity`` is then none.

        Raises:
            InputError: The array cannot tell these sides, or tells all places.
        """
        level = self.ahead is None or abs(self.ahead[-1]) <= _FLATNESS
        names = ("ahead", "behind") if self.dimension == 2 or level else _UPRIGHT
        if self.ahead is None:
            raise InputError(
                "side", f"is {side}, but this array distinguishes all sides; remove it"
            )
        if side not in names:
            raise InputError(
                "side",
                f"is {side}, but this array distinguishes only {names[0]} and "
                f"{names[1]}; give one of them",
            )
        turned = side == names[1]
        return replace(
            self,
            ahead=-self.ahead if turned else self.ahead,
            span=-self.span if turned and self.kind == "row" else self.span,
            side=side,
        )

    def max_delay(self, c: float) -> float:
        """Longest time that sound takes from microphone to microphone, s."""
        return self.aperture_m / c

    @cached_property
    def equal_row(self) -> EqualRow | None:
        """Three microphones equally spaced in a row; None for all others."""
        ahead = self.ahead
        if ahead is None or self.kind != "row" or self.count != 3:
            return None
        along = self.p_AM @ self.span[0]
        right, middle, left = (int(k) for k in np.argsort(along))
        off = np.linalg.norm(self.p_AM - np.outer(along, self.span[0]), axis=1).max()
        # The closed form is exact only for an exact row.
        if max(off, abs(along[middle])) > 1e-9 * self.aperture_m:
            return None
        arrivals = np.vstack((np.zeros((1, 2)), np.eye(2)))  # by the delays
        return EqualRow(
            spacing_m=float(along[left] - along[right]) / 2.0,
            to_delays=arrivals[[middle, right]] - arrivals[left],
            axes=np.stack((ahead, self.span[0]), axis=1),
        )


def _check(p: NDArray[np.float64]) -> None:
    if len(p) < 3:
        raise InputError("microphones", f"{len(p)} given; a source takes at least 3")
    wrong = np.flatnonzero(~np.isfinite(p).all(axis=1))
    if wrong.size:
        raise InputError(
            "microphones",
            f"the position {p[wrong[0]].tolist()} of number "
            f"{wrong[0] + 1} is not finite; give numbers in m",
        )
    first, second = np.triu_indices(len(p), 1)
    distances = _distances(p)[first, second]
    k = int(distances.argmin())
    if distances[k] < _LEAST_DISTANCE_M:
        raise InputError(
            "microphones",
            f"numbers {first[k] + 1} and {second[k] + 1} are "
            f"{distances[k] * 1e3:.3g} mm apart; they must be at least "
            f"{_LEAST_DISTANCE_M * 1e3:g} mm (positions are in m)",
        )


def _distances(p: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(p[:, np.newaxis] - p[np.newaxis], axis=2)


def _upward(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """The normal that points up; forward, or else left, if it is level."""
    for part in normal[::-1] if abs(normal[2]) > _FLATNESS else normal:
        if abs(part) > _FLATNESS:
            return normal * np.sign(part)
    raise AssertionError("a unit vector has a part")


def _row_axes(
    along: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Level unit vector ahead of a row, and the one along the row to its left."""
    ahead = np.zeros(along.size)
    level = np.hypot(along[0], along[1])
    if level < _FLATNESS:  # upright: any direction is ahead
        ahead[0] = 1.0
        ahead -= (ahead @ along) * along
        return ahead / np.linalg.norm(ahead), along * np.sign(along[2])
    ahead[:2] = along[1] / level, -along[0] / level
    if ahead[0] < -1e-9 or (abs(ahead[0]) <= 1e-9 and ahead[1] < 0.0):
        ahead = -ahead
    left = -ahead[1] * along[0] + ahead[0] * along[1]
    return ahead, along * np.sign(left)
