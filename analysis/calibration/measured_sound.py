"""What is measured of a sound, and where it was made as far as that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

# Of a microphone: the wave front is then no longer that of a point.
_NEAREST_M = 0.05
_FARTHEST_M = 1000.0


@dataclass(frozen=True)
class MeasuredSound:
    """Delays of one resting sound at n microphones."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) of the delays, without errors of the array and the air, s^2."""
    position: NDArray[np.float64] | None = None
    """(d,) where it was made, in the microphones' frame, m. None: not known."""
    position_std: float = 0.0
    """Of each coordinate of the position, m."""
    name: str = ""
    """By which messages name it."""


def check_sounds(
    places: NDArray[np.float64], sounds: Sequence[MeasuredSound], field: str = "sounds"
) -> None:
    """Refuses sounds that no array at these places can be calibrated with.

    Args:
        places: (n, d) microphones, m.
        sounds: The sounds.
        field: Begins the message of an error.

    Raises:
        InputError: There are none, they have another number of delays or of
            coordinates than the array, or a position is at a microphone or far out.
    """
    if not sounds:
        raise InputError(
            field,
            "are empty; give at least one sound that was made at a known position",
        )
    for k, sound in enumerate(sounds):
        where = f"{field}.{k}"
        if sound.tau.shape != (len(places) - 1,):
            raise InputError(
                where,
                f"has {sound.tau.size} delays; {len(places)} microphones have "
                f"{len(places) - 1}",
            )
        if sound.position is not None:
            check_position(places, sound.position, f"{where}.position_m")


def check_position(
    places: NDArray[np.float64], position: NDArray[np.float64], field: str
) -> None:
    """Refuses a position where no sound can have been made.

    Args:
        places: (n, d) microphones, m.
        position: Coordinates in the same frame, m.
        field: Begins the message of an error.

    Raises:
        InputError: It has another number of coordinates than the microphones, or is
            too near or too far.
    """
    dimension = places.shape[1]
    if position.shape != (dimension,):
        coordinates = ("[x, y]", "[x, y, z]")
        raise InputError(
            field,
            f"{position.tolist()} has {position.size} coordinates and the microphones "
            f"have {dimension}; give {coordinates[dimension - 2]}, or the microphones "
            f"as {coordinates[3 - dimension]}",
        )
    distances = np.linalg.norm(places - position, axis=1)
    nearest = int(distances.argmin())
    if distances[nearest] < _NEAREST_M:
        raise InputError(
            field,
            f"{position.tolist()} is {100.0 * distances[nearest]:.1f} cm from "
            f"microphone {nearest + 1}; make sounds at least "
            f"{100.0 * _NEAREST_M:g} cm away, and give positions in m",
        )
    if distances[nearest] > _FARTHEST_M:
        raise InputError(
            field,
            f"{position.tolist()} is {distances[nearest]:.4g} m from the microphones; "
            f"give positions in m, at most {_FARTHEST_M:g} m away",
        )
