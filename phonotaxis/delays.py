"""Sources and arrays that follow from measured delays between microphones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from analysis.arrays.array_geometry import ArrayGeometry, make_geometry
from analysis.arrays.calibrate_delays import calibrate_by_delays
from analysis.arrays.delay_places import DelayPlaces, delay_places
from analysis.arrays.delay_places_text import (
    delays_document,
    delays_notes,
    delays_text,
    plot_delays,
)
from analysis.report.plain_values import write_json
from phonotaxis.recordings import CalibrationResult, logged
from phonotaxis.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DelayResult", "calibrate_delays", "locate_delays"]


class DelayResult(DelayPlaces, Result):
    """Directions or positions of sounds whose delays were measured."""

    def __repr__(self) -> str:
        return (
            f"<DelayResult {len(self.geometry.microphones)} microphones, "
            f"{len(self.estimates)} sounds>"
        )

    def document(self) -> dict[str, Any]:
        """Returns the JSON document."""
        return delays_document(self)

    def __str__(self) -> str:
        """One row per sound, for a terminal."""
        return delays_text(self)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is wrong with the delays."""
        return tuple(delays_notes(self))

    def plot(self) -> Figure:
        """Draws the microphones and the located sounds from above."""
        return plot_delays(self)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``delays.json`` and ``delays.png``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_json(document, directory / "delays.json")
        self.plot().savefig(directory / "delays.png", dpi=150)


def locate_delays(
    delays: ArrayLike,
    places: ArrayGeometry | str | Path | Sequence[Sequence[float]],
    *,
    covariance: ArrayLike | None = None,
) -> DelayResult:
    """Locates sounds from measured delays between n microphones.

    If no place explains the delays within their stated errors, the errors are raised
    until one does. A warning of the logger ``phonotaxis``, and ``notes`` of the result,
    then say so. They also list delays that are impossible because sound cannot travel
    so long. The result does not depend on impossible delays.

    Args:
        delays: (n - 1,) delays t_k - t_0 of microphones 1 ... n - 1 after microphone 0,
            s. Or (k, n - 1) delays of k sounds. NaN is a delay that was not measured.
        places: Geometry of the n microphones, the path of a geometry file, or a list of
            positions (x, y) or (x, y, z) in m.
        covariance: (n - 1, n - 1) covariance of the errors of the delays, s^2, or
            (k, n - 1, n - 1) for each sound. Independent arrival times with the
            standard deviation s give ``s**2 * (np.eye(n - 1) + 1)``. None: independent
            arrival times, whose standard deviation follows from the misfit of the
            delays. This needs more delays than unknowns.

    Returns:
        One estimate per sound: a position if the delays determine the range, otherwise
        a direction, with their covariance and with other places of equal delays.

    Raises:
        InputError: The delays, the covariance or the microphones cannot be used. The
            message states the cause and the remedy.
    """
    found = delay_places(delays, make_geometry(places), covariance)
    return logged(DelayResult(**vars(found)))


def calibrate_delays(
    delays: ArrayLike,
    places: ArrayGeometry | str | Path | Sequence[Sequence[float]],
    *,
    covariance: ArrayLike | None = None,
    positions_m: ArrayLike | None = None,
    position_std_m: float = 0.01,
) -> CalibrationResult:
    """Calibrates an array of n microphones by measured delays of k sounds.

    The result is that of ``phonotaxis.calibrate``. Its ``geometry`` is the calibrated
    array, for ``locate_delays``, ``locate`` and ``listen``.

    Args:
        delays: (k, n - 1) delays t_k - t_0, s; see ``locate_delays``.
        places: Stated positions of the microphones with their uncertainties; see
            ``locate_delays``.
        covariance: Covariance of the errors of the delays, s^2; see ``locate_delays``.
            If it is None, sounds that fit much worse than the others count less.
        positions_m: (k, d) positions of the sounds in the frame of the microphones, m.
            None: they are unknown.
        position_std_m: Standard deviation of each coordinate of these positions, m.

    Returns:
        The calibrated array.

    Raises:
        InputError: The delays, the covariance, the positions or the microphones cannot
            be used. The message states the cause and the remedy.
    """
    run = calibrate_by_delays(
        delays, make_geometry(places), covariance, positions_m, position_std_m
    )
    return logged(CalibrationResult(run))
