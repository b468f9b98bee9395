"""What a geometry file makes of the array: its budget and its side."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.arrays.array_geometry import ArrayGeometry, load_geometry

ROW = ((0.0, 0.4), (0.0, 0.0), (0.0, -0.4))
LEVEL = ((0.1, 0.1, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0), (0.1, -0.1, 0.0))


def known(**fields):
    return ArrayGeometry.model_validate({"microphones": ROW, **fields}).known


def test_nothing_is_known_exactly_unless_it_is_said():
    budget = known().budget
    assert budget.position_std == pytest.approx(0.008)  # 1 % of 0.8 m
    assert budget.speed_std == pytest.approx(3.4)  # 1 % of 340 m/s
    assert budget.delay_std == 1e-6
    assert known(sound_speed=345.0).budget.speed_std == pytest.approx(1.2)  # 2 deg C
    small = ArrayGeometry(microphones=((0.0, 0.01), (0.0, 0.0), (0.0, -0.01)))
    assert small.known.budget.position_std == pytest.approx(0.0005)


def test_temperature_moves_the_speed_by_its_slope():
    budget = known(temperature_c=20.0, temperature_std_c=5.0).budget
    assert budget.speed_std == pytest.approx(0.6 * 5.0)  # Han 2019, eq. 23


def test_places_one_for_all_one_each_and_as_a_covariance():
    alike = known(position_std_m=0.002).budget.of_places
    np.testing.assert_allclose(alike, 4e-6 * np.eye(6))
    each = known(position_std_m=[0.001, 0.002, 0.003]).budget.of_places
    np.testing.assert_allclose(np.diag(each), [1e-6, 1e-6, 4e-6, 4e-6, 9e-6, 9e-6])
    one = [[4e-6, 1e-6], [1e-6, 2e-6]]
    blocks = known(position_covariance_m2=one).budget.of_places
    np.testing.assert_allclose(blocks[2:4, 2:4], one)
    np.testing.assert_allclose(blocks[:2, 2:], 0.0)
    mixed = np.random.default_rng(1).standard_normal((6, 6))
    whole = 1e-6 * mixed @ mixed.T
    joint = known(position_covariance_m2=whole.tolist()).budget.of_places
    np.testing.assert_allclose(joint, whole)


@pytest.mark.parametrize(
    ("microphones", "side", "ahead"),
    [
        (ROW, "ahead", [1, 0]),
        (ROW, "behind", [-1, 0]),
        (LEVEL, "above", [0, 0, 1]),
        (LEVEL, "below", [0, 0, -1]),
    ],
)
def test_the_side_that_is_stated_is_no_longer_ambiguous(microphones, side, ahead):
    shape = ArrayGeometry(microphones=microphones, side=side).known.shape
    assert shape.ahead is not None
    np.testing.assert_allclose(shape.ahead, ahead, atol=1e-12)
    assert shape.ambiguity == "none"
    assert ArrayGeometry(microphones=microphones).known.shape.ambiguity != "none"


def test_budget_in_a_file(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "microphones: [[0, 0.4], [0, 0], [0, -0.4]]\nposition_std_m: 0.003\n"
        "sound_speed: 343\nsound_speed_std: 0.5\ndelay_std_s: 2.0e-6\n"
        "gain_std_db: 1\nlargest_range_error: 0.1\nside: behind\n"
    )
    array = load_geometry(path).known
    assert array.budget.position_std == pytest.approx(0.003)
    assert (array.budget.speed_std, array.budget.delay_std) == (0.5, 2e-6)
    assert (array.gain_std_db, array.largest_range_error) == (1.0, 0.1)
