"""Export of linear models to MATLAB and CSV files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.io import savemat

from analysis.loops.linear_models import LinearModel
from analysis.report.file_names import distinct_names


def write_models(models: Sequence[LinearModel], directory: Path) -> None:
    """Writes linear models to ``models.mat`` and to CSV files in ``models/``.

    In ``models.mat`` each model is a struct with the fields A, B, C, D, Ts, StateName,
    InputName and OutputName. Ts is the sample period in s. In continuous time Ts is 0,
    as in MATLAB's ``ss``.

    Each matrix also has a CSV file: ``models/NAME_A.csv``, ``_B``, ``_C`` and ``_D``.
    The first row has the names of the columns, the first column the names of the rows.
    If several models have the same name, the second gets the suffix ``_2``, and so on.
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
    """Turns a name into a valid name of a MATLAB variable."""
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
