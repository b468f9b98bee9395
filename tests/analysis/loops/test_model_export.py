"""Linear models as .mat and .csv."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
from scipy.io import loadmat

from analysis.loops.linear_models import LinearModel
from analysis.loops.model_export import write_models

MODEL = LinearModel(
    name="sampled loop, active",
    A=np.array([[0.1, 1.0 / 3.0], [-2.0, 0.0]]),
    B=np.array([[1.0], [2.0]]),
    C=np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]),
    D=np.zeros((3, 1)),
    state_names=("plant.x", "plant.y"),
    input_names=("force",),
    output_names=("x", "y", "sum"),
    period_s=0.025,
)


def test_mat_file_holds_matrices_and_names(tmp_path):
    continuous = dataclasses.replace(MODEL, name="target", period_s=None)
    write_models([MODEL, continuous], tmp_path)
    data = loadmat(tmp_path / "models.mat", simplify_cells=True)
    loop = data["sampled_loop_active"]
    np.testing.assert_array_equal(loop["A"], MODEL.A)
    np.testing.assert_array_equal(loop["B"].reshape(2, 1), MODEL.B)
    assert loop["Ts"] == 0.025
    assert data["target"]["Ts"] == 0.0
    assert list(loop["StateName"]) == list(MODEL.state_names)
    assert list(loop["OutputName"]) == list(MODEL.output_names)


def test_csv_files_are_exact_and_named(tmp_path):
    write_models([MODEL], tmp_path)
    folder = tmp_path / "models"
    A = pd.read_csv(folder / "sampled_loop_active_A.csv", index_col=0)
    assert (A.to_numpy() == MODEL.A).all()
    assert list(A.columns) == list(A.index) == list(MODEL.state_names)
    C = pd.read_csv(folder / "sampled_loop_active_C.csv", index_col=0)
    assert list(C.index) == list(MODEL.output_names)
    assert len(list(folder.iterdir())) == 4


def test_models_whose_names_would_be_one_file(tmp_path):
    """As of two laws, my_laws.py:Soft and my_laws:py_soft, or of one in Greek."""
    names = ["laws.py:Soft loop", "laws_py:soft loop", "\u03bb.py:\u03bb", "x" * 300]
    models = [dataclasses.replace(MODEL, name=name) for name in names]
    write_models(models, tmp_path)
    stems = ["laws_py_Soft_loop", "laws_py_soft_loop_2", "py", "x" * 200]
    files = {path.name for path in (tmp_path / "models").iterdir()}
    assert files == {f"{stem}_{matrix}.csv" for stem in stems for matrix in "ABCD"}
    structs = loadmat(tmp_path / "models.mat")
    assert set(stems) <= structs.keys()
