"""Linear models as files that other programs read."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.io import savemat

from analysis.models.linear_models import LinearModel
from analysis.reporting.file_names import distinct_names


def write_models(models: Sequence[LinearModel], directory: Path) -> None:
    """Writes ``models.mat`` and ``models/NAME_A.csv``, ``_B``, ``_C``, ``_D``.

    In the .mat file each model is a struct with the fields A, B, C, D, Ts (s; 0
    where time is continuous, as in MATLAB's ``ss``), StateName, InputName and
    OutputName. A .csv file has the names of its columns in the first row and
    those of its rows in the first column.

    Args:
        models: Of those with one name the second gets a 2 after it, and so on.
        directory: Exists.
    """
    names = distinct_names([_identifier(m.name) for m in models], joint="_")
    structs = {name: _struct(model) for name, model in zip(names, models, strict=True)}
    savemat(directory / "models.mat", structs, long_field_names=True)
    folder = directory / "models"
    folder.mkdir()
    for name, model in zip(names, models, strict=True):
        x, u, y = model.state_names, model.input_names, model.output_names
        for matrix, values, row_names, columns in (
            ("A", model.A, x, x),
            ("B", model.B, x, u),
            ("C", model.C, y, x),
            ("D", model.D, y, u),
        ):
            named = pd.DataFrame(values, row_names, columns)
            named.to_csv(folder / f"{name}_{matrix}.csv", lineterminator="\n")


def _identifier(name: str) -> str:
    """A name that MATLAB takes for a variable's."""
    return re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")


def _struct(model: LinearModel) -> dict[str, object]:
    def cells(names: Sequence[str]) -> NDArray[np.object_]:
        return np.array(names, dtype=object).reshape(-1, 1)

    return {
        "A": model.A,
        "B": model.B,
        "C": model.C,
        "D": model.D,
        "Ts": model.period_s or 0.0,
        "StateName": cells(model.state_names),
        "InputName": cells(model.input_names),
        "OutputName": cells(model.output_names),
    }
