"""Determines the shape of a microphone array and the ambiguities of its delays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.framework.input_error import InputError
from systems.sound.rigid_sphere import RigidSphere

# Smallest distance between two microphones, m.
_LEAST_DISTANCE_M = 1e-3

# A microphone counts as on a line or a plane if its distance from the line or plane is
# at most this share of the aperture.
_FLATNESS = 0.01

_UPRIGHT = ("above", "below")


class EqualRow(NamedTuple):
    """Three microphones M1, M2, M3, from left to right when looking ahead."""

    spacing_m: float
    """Distance between adjacent microphones, m."""
    to_delays: NDArray[np.float64]
    """(2, 2) matrix that converts delays relative to the first channel of the array to
    tau_12 and tau_13. The delay tau_ij is the time by which the sound reaches
    microphone j of the row later than microphone i."""
    axes: NDArray[np.float64]
    """(d, 2) matrix of two unit vectors. The first column points ahead of the row, and
    the second column points to the left."""


@dataclass(frozen=True)
class ArrayShape:
    """Positions of microphones relative to their centroid, in the frame A of the array.

    The frame A has the axes in which the positions were given. Its origin is the
    centroid. To make a shape, call ``ArrayShape.of``.
    """

    p_AM: NDArray[np.float64]
    """(n, d) positions of the microphones, m; d is 2 or 3."""
    kind: Literal["row", "plane", "space"]
    """Kind of set that the microphones span: a line, a plane, or space."""
    span: NDArray[np.float64]
    """(r, d) orthonormal vectors in A that span the array. For a row, the vector points
    to the left of the direction ``ahead``."""
    ahead: NDArray[np.float64] | None
    """(d,) unit vector perpendicular to the row or plane of microphones. It points to
    the side on which sources are reported. None if the array distinguishes both sides.

    By default, the vector points toward +x for a row of microphones, or toward +y if
    the row is along x. For a plane in space, it points toward +z. The rule for rows
    also applies to an upright plane.
    """
    aperture_m: float
    """Largest distance between two microphones, m."""
    side: Literal["ahead", "behind", "above", "below"] | None = None
    """Side on which all sources are known to be; None: both sides are possible."""
    body: RigidSphere | None = None
    """Rigid sphere that carries the microphones; None: free air. If there is a sphere,
    the positions are those in free air whose delays fit best."""

    @classmethod
    def of(cls, positions: ArrayLike, flat_m: float | None = None) -> ArrayShape:
        """Makes the shape of an array from the positions of its microphones.

        Args:
            positions: (n, 2) or (n, 3) positions in any frame, m; n is at least 2.
            flat_m: The microphones form a row or plane if none of them is farther than
                this distance from a line or plane, m. None: 1 % of the aperture.

        Returns:
            The microphones relative to their centroid, and the line, plane, or space
            that they span.

        Raises:
            InputError: There are fewer than 2 positions, two positions nearly coincide,
                a position is not finite, or the shape of the positions is wrong.
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
        # A row: all microphones are within the limit of the longest axis. A plane: all
        # are within the limit of the plane of the two longest axes.
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
        """Directions that the delays of the array cannot distinguish.

        ``none``: there are no such directions. ``front_back``: a direction and its
        mirror image behind the row have equal delays. ``mirror``: a direction and its
        mirror image on the other side of the plane have equal delays. A row in space
        has a larger ambiguity: all positions on a circle around the row have equal
        delays.
        """
        if self.ahead is None or self.side is not None:
            return "none"
        return "front_back" if self.kind == "row" else "mirror"

    @property
    def unknowns(self) -> int:
        """Largest number of unknowns that delays determine: angles, and the range."""
        return len(self.span) + (self.ahead is not None)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residuals of the delays; 0 or less means none."""
        return self.count - 1 - self.unknowns

    @cached_property
    def angles(self) -> tuple[Literal["bearing", "elevation"], ...]:
        """Angles of a direction that the delays of the array determine.

        A slanted row determines neither bearing nor elevation. It determines only the
        angle between the direction and the row.
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
        """Returns the same array, for sources that are all on one known side.

        Args:
            side: ``ahead`` is toward +x, or toward +y for a row along x. ``above`` is
                toward +z. ``behind`` and ``below`` are the opposite sides.

        Returns:
            The shape that faces this side. Its ``ambiguity`` is ``none``.

        Raises:
            InputError: The delays of the array do not confuse this side with the
                opposite side.
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
        """Returns the longest travel time of sound between two microphones, s."""
        return self.aperture_m / c

    @cached_property
    def equal_row(self) -> EqualRow | None:
        """Returns a row of three equally spaced microphones; None for other arrays."""
        ahead = self.ahead
        if ahead is None or self.kind != "row" or self.count != 3:
            return None
        along = self.p_AM @ self.span[0]
        right, middle, left = (int(k) for k in np.argsort(along))
        off = np.linalg.norm(self.p_AM - np.outer(along, self.span[0]), axis=1).max()
        # The closed form is exact only if the row is straight and equally spaced.
        if max(off, abs(along[middle])) > 1e-9 * self.aperture_m:
            return None
        # Row k expresses t_k - t_0 by the delays.
        arrivals = np.vstack((np.zeros((1, 2)), np.eye(2)))
        return EqualRow(
            spacing_m=float(along[left] - along[right]) / 2.0,
            to_delays=arrivals[[middle, right]] - arrivals[left],
            axes=np.stack((ahead, self.span[0]), axis=1),
        )


def _check(p: NDArray[np.float64]) -> None:
    if len(p) < 2:
        raise InputError("microphones", f"{len(p)} given; a direction takes at least 2")
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
    """Returns the normal that points up; a level normal points to +x or +y."""
    for part in normal[::-1] if abs(normal[2]) > _FLATNESS else normal:
        if abs(part) > _FLATNESS:
            return normal * np.sign(part)
    raise AssertionError("a unit vector has a part")


def _row_axes(
    along: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns the unit vector ahead of a row, and the one along the row to the left."""
    ahead = np.zeros(along.size)
    level = np.hypot(along[0], along[1])
    if level < _FLATNESS:  # an upright row: any level direction can be ahead
        ahead[0] = 1.0
        ahead -= (ahead @ along) * along
        return ahead / np.linalg.norm(ahead), along * np.sign(along[2])
    ahead[:2] = along[1] / level, -along[0] / level
    if ahead[0] < -1e-9 or (abs(ahead[0]) <= 1e-9 and ahead[1] < 0.0):
        ahead = -ahead
    left = -ahead[1] * along[0] + ahead[0] * along[1]
    return ahead, along * np.sign(left)
