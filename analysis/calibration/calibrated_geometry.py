"""Writes a calibrated array as a geometry file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.calibration.calibration import Calibration
from analysis.recordings.array_geometry import ArrayGeometry
from analysis.reporting.plain_values import write_json
from diagrams.scenario.yaml_text import LARGEST_BYTES, dump_yaml
from systems.framework.input_error import InputError
from systems.sound.array_shape import ArrayShape

_Side = Literal["ahead", "behind", "above", "below"]

# Fields that the calibration replaces.
_REPLACED = frozenset(
    {
        "microphones",
        "position_std_m",
        "position_covariance_m2",
        "sound_speed",
        "sound_speed_std",
        "temperature_c",
        "temperature_std_c",
    }
)

# _DIGITS: significant digits to try for a covariance, finest first.
# _AROUND: characters of YAML that surround each number.
_DIGITS, _AROUND = (17, 9), 8


def calibrated_fields(
    calibration: Calibration, geometry: ArrayGeometry
) -> dict[str, Any]:
    """Computes the fields of a geometry file for a calibrated array.

    Fields that were not calibrated are copied from the array as stated. If the array is
    too large for a covariance in the file, the file holds one standard deviation per
    microphone. If the calibrated microphones no longer lie in a plane or line, the
    field ``side`` is left out.
    """
    fields = {
        "microphones": calibration.places.tolist(),
        **_uncertainty(calibration),
        "sound_speed": calibration.c,
        "sound_speed_std": calibration.speed_std,
    }
    dropped = set(_REPLACED)
    if geometry.side is not None and not _has_side(calibration, geometry.side):
        dropped.add("side")
    kept = geometry.model_dump(mode="json", exclude_none=True, exclude=dropped)
    return {**fields, **kept}


def write_calibration(document: dict[str, Any], folder: Path) -> None:
    """Writes ``calibration.json``, and ``array.yaml`` for ``load_geometry``."""
    write_json(document, folder / "calibration.json")
    text = dump_yaml(document["geometry"])
    (folder / "array.yaml").write_text(text, encoding="utf-8")


def _has_side(calibration: Calibration, side: _Side) -> bool:
    try:
        ArrayShape.of(calibration.places).facing(side)
    except InputError:
        return False
    return True


def _uncertainty(calibration: Calibration) -> dict[str, Any]:
    covariance = calibration.of_places
    for digits in _DIGITS:
        if covariance.size * (digits + _AROUND) < LARGEST_BYTES:
            return {"position_covariance_m2": _rounded(covariance, digits)}
    variances = np.diag(covariance).reshape(calibration.places.shape)
    return {"position_std_m": np.sqrt(variances.mean(axis=1)).tolist()}


def _rounded(matrix: NDArray[np.float64], digits: int) -> list[list[float]]:
    symmetric = (matrix + matrix.T) / 2.0
    return [[float(f"{value:.{digits}g}") for value in row] for row in symmetric]
