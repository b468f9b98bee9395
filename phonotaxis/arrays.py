"""What a microphone array can resolve, predicted from its geometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.arrays.array_geometry import ArrayGeometry, make_geometry
from analysis.arrays.array_resolution import ArrayResolution, resolution
from analysis.arrays.array_resolution_text import (
    plot_resolution,
    resolution_document,
    resolution_text,
    write_resolution,
)
from phonotaxis.result import Prepared, Result, ignore

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ResolutionResult", "array_resolution"]


class ResolutionResult(ArrayResolution, Result):
    """Predicted errors of an array over direction and distance."""

    def __repr__(self) -> str:
        return f"<ResolutionResult {len(self.geometry.microphones)} microphones>"

    def document(self) -> dict[str, Any]:
        """Returns the JSON document of ``phonotaxis array``."""
        return resolution_document(self)

    def __str__(self) -> str:
        """Tables of the errors, for a terminal."""
        return resolution_text(self)

    def plot(self) -> Figure:
        """Draws the errors over the bearing."""
        return plot_resolution(self)

    def write(self, document: dict[str, Any], directory: Path) -> None:
        """Writes ``array.json`` and ``array.png``.

        Args:
            document: The JSON document, with the key ``out``.
            directory: Existing directory.
        """
        write_resolution(self, document, directory)


def array_resolution(
    geometry: ArrayGeometry | str | Path | Sequence[Sequence[float]] | None = None,
    *,
    snr_db: float = 20.0,
    seconds: float = 0.5,
) -> ResolutionResult:
    """Predicts what an array can resolve, without a recording.

    Args:
        geometry: Geometry of the microphones, the path of a geometry file, or a list of
            positions (x, y) or (x, y, z) in m. None: the robot's own array.
        snr_db: Level of the sound over the noise of a microphone in the band of the
            geometry, dB, from -40 to 80.
        seconds: Duration of the sound, s, up to 3600.

    Returns:
        Standard deviations of bearing, elevation and range over direction and distance,
        ambiguities, useful frequencies, and the effect of a better array. Echoes are
        not included.

    Raises:
        InputError: The geometry or a value cannot be used. The message states the cause
            and the remedy.
    """
    return prepare_resolution(make_geometry(geometry), snr_db, seconds).run(ignore)


def prepare_resolution(
    geometry: ArrayGeometry, snr_db: float, seconds: float
) -> Prepared[ResolutionResult]:
    """Prepares the prediction; see ``array_resolution``."""
    return Prepared(
        run=lambda _: ResolutionResult(**vars(resolution(geometry, snr_db, seconds)))
    )
