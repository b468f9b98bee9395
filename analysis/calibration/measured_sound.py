"""Measured delays of a sound, and the sound's position as far as known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from systems.framework.input_error import InputError

# Least distance of a source from a microphone, m. A nearer source is no point source.
_NEAREST_M = 0.05
# Largest distance of a source from a microphone, m.
_FARTHEST_M = 1000.0


@dataclass(frozen=True)
class MeasuredSound:
    """Delays of one sound, from a source at rest, at n microphones."""

    tau: NDArray[np.float64]
    """(n - 1,) delays t_k - t_0, s."""
    covariance: NDArray[np.float64]
    """(n - 1, n - 1) covariance of the delays, without array and air errors, s^2."""
    position: NDArray[np.float64] | None = None
    """(d,) position of the source in the microphones' frame, m. None: not known."""
    position_std: float = 0.0
    """Standard deviation of each coordinate of ``position``, m."""
    name: str = ""
    """Name of the sound in messages."""


def check_sounds(
    places: NDArray[np.float64], sounds: Sequence[MeasuredSound], field: str = "sounds"
) -> None:
    """Checks that sounds are suitable to calibrate microphones at (n, d) places in m.

    Raises ``InputError``, whose message begins with ``field``, if there are no sounds,
    if a sound does not have n - 1 delays, or if a source position is not plausible.
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
    """Checks that a stated position of a sound is plausible.

    Raises ``InputError`` for ``field`` if the (d,) position, in m, does not have as
    many coordinates as the (n, d) microphone positions ``places``, if it is less than 5
    cm from a microphone, or if it is more than 1 km from the nearest microphone.
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
