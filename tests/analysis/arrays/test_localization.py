"""The papers' localization experiment: what is heard, counted and written."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Ellipse

from analysis.arrays.cramer_rao import LocalizationBound
from analysis.arrays.listener import Heard, Listener
from analysis.arrays.localization import (
    LocalizationCell,
    LocalizationExperiment,
    prepare_localization,
)
from analysis.arrays.localization_plots import plot_localization
from analysis.arrays.localization_report import (
    localization_document,
    localization_text,
)
from analysis.arrays.paper_tables import PAPER_CELLS
from analysis.arrays.sensitivity import PolarStd

NEAR, SIDE = PAPER_CELLS[0], PAPER_CELLS[5]
TRIALS = 12


@pytest.fixture(scope="module")
def experiment() -> LocalizationExperiment:
    return replace(prepare_localization(trials=TRIALS), places=(NEAR, SIDE))


@pytest.fixture(scope="module")
def cells(experiment) -> list[LocalizationCell]:
    return experiment.run()


@pytest.fixture(scope="module")
def summary(experiment, cells):
    return localization_document(experiment, cells)


def test_every_place_has_every_estimator(cells):
    assert [(cell.paper, cell.estimator) for cell in cells] == [
        (place, name) for place in (NEAR, SIDE) for name in ("paper", "fast", "ml")
    ]


def test_ours_are_near_the_bound_and_the_papers_is_not(cells):
    """RMSE over bound of 12 trials: 99.9 % lie below 1.7."""
    for cell in cells:
        heard, place = cell.heard, cell.paper
        assert len(heard.bearings) == len(heard.ranges) == TRIALS
        errors = heard.ranges - place.range_m
        ratio = math.sqrt(np.mean(errors**2)) / heard.bound.range_std
        turned = heard.bearings - math.radians(place.bearing_deg)
        if cell.estimator == "paper":
            assert ratio > 5.0
        else:
            assert ratio < 1.7
            assert math.sqrt(np.mean(turned**2)) < 1.7 * heard.bound.bearing_std


def test_whole_sample_delays_lead_where_the_closed_form_says(cells):
    """Delays rounded to 10 us, put into equation 8 of Kim 2017."""
    c, spacing = 340.0, 0.4
    ranges = [math.hypot(1.0, y) for y in (spacing, 0.0, -spacing)]
    samples = [round((r - ranges[0]) / c * 1e5) for r in ranges]
    a, b = (c * sample * 1e-5 for sample in samples[1:])
    r1 = (2 * spacing**2 + 2 * a * a - b * b) / (2 * (b - 2 * a))
    paper = next(cell for cell in cells if cell.estimator == "paper")
    np.testing.assert_allclose(paper.heard.ranges, r1 + a, rtol=1e-6)


def test_run_again_it_is_the_same(experiment, cells):
    again = replace(experiment, estimators=("fast",), places=(NEAR,)).run()[0]
    same = next(cell for cell in cells if cell.estimator == "fast")
    np.testing.assert_array_equal(again.heard.ranges, same.heard.ranges)


def test_tolerances_are_redrawn_for_every_frame():
    """Ranges spread as predicted, 20 times the noise's share."""
    experiment = prepare_localization(["seed=3"], trials=60, tolerances=True)
    cell = replace(experiment, estimators=("fast",), places=(NEAR,)).run()[0]
    spread = cell.heard.ranges.std()
    assert spread > 10.0 * cell.heard.bound.range_std
    # The standard deviation of 60 draws is known to 9 %.
    assert spread == pytest.approx(cell.tolerance.range, rel=0.3)


def test_estimators_hear_the_same_array(experiment):
    drawn = prepare_localization(trials=TRIALS, tolerances=True)
    fast, ml = replace(drawn, estimators=("fast", "ml"), places=(NEAR,)).run()
    np.testing.assert_allclose(
        fast.heard.ranges, ml.heard.ranges, atol=3.0 * fast.heard.bound.range_std
    )


def test_a_frame_without_sound_is_no_measurement():
    """Sound of 0.1 s in 0.5 s: what is not heard is missing, not zero."""
    experiment = prepare_localization(["sound.on_s=0.1"], trials=40)
    heard = Listener(experiment.scenario).listen(1.0, 0.0, 40)
    assert 5 <= len(heard.bearings) <= 10
    np.testing.assert_allclose(heard.ranges, 1.0, atol=0.05)


def lost(trials: int, bearings: list[float], ranges: list[float]) -> LocalizationCell:
    bound = LocalizationBound(np.eye(2), np.eye(2), 1e-3, None, 1e-2)
    positions = np.array([[r, 0.0] for r in ranges]).reshape(-1, 2)
    heard = Heard(
        np.array([1.0, 0.0]), np.array(bearings), np.array(ranges), positions, bound
    )
    return LocalizationCell(NEAR, "fast", trials, heard, PolarStd(0.0, 0.0))


def test_what_is_lost_is_counted_and_never_zero(summary):
    cell = lost(10, [0.1, 0.2, 0.3], [2.0])
    row = cell.to_dict()
    assert (row["unheard"], row["rangeless"]) == (7, 2)
    assert row["range_mean_m"] == 2.0
    assert row["range_rmse_m"] == 1.0
    assert row["range_std_m"] is None
    nothing = lost(10, [], []).to_dict()
    assert nothing["range_mean_m"] is nothing["bearing_rmse_deg"] is None
    text = localization_text({**summary, "cells": [row]})
    assert "2.000 - (9)" in text
    assert "none (10)" in localization_text({**summary, "cells": [nothing]})


def test_json_document(summary):
    document = json.loads(json.dumps(summary, allow_nan=False))
    assert document["schema_version"] == 2
    cell = document["cells"][3]
    assert {
        "range_m", "bearing_deg", "estimator", "trials", "range_mean_m", "range_std_m",
        "range_rmse_m", "bearing_mean_deg", "bearing_std_deg", "bearing_rmse_deg",
        "bound_range_m", "bound_bearing_deg", "paper",
    } <= set(cell)  # fmt: skip
    assert cell["range_m"] == 2.0
    assert cell["bearing_deg"] == 60.0
    assert cell["paper"]["range_std_m"] == 0.13
    assert len(document["sensitivity"]) == 2 * 4


def test_moments_agree_with_each_other(cells):
    """RMSE^2 is bias^2 and variance."""
    for cell in cells:
        row = cell.to_dict()
        bias = row["range_mean_m"] - row["range_m"]
        variance = row["range_std_m"] ** 2 * (TRIALS - 1) / TRIALS
        assert row["range_rmse_m"] ** 2 == pytest.approx(bias**2 + variance)


def test_tables_hold_the_numbers(summary, cells):
    text = localization_text(summary)
    row = next(line for line in text.splitlines() if line.startswith("   2 m    60"))
    numbers = [float(word) for word in row.split()[4:]]
    paper = PAPER_CELLS[5]
    assert numbers[:2] == [paper.range_mean_m, paper.range_std_m]
    assert numbers[2] == pytest.approx(cells[3].heard.ranges.mean(), abs=5e-4)
    assert numbers[-2] == pytest.approx(cells[3].heard.bound.range_std, abs=5e-5)


def test_picture_states_its_exaggeration(cells):
    left, right = plot_localization(cells).axes
    assert left.get_aspect() == right.get_aspect() == 1.0
    factors = [numbers(text.get_text()) for text in right.texts]
    assert len(factors) == 2
    # Half axes of two standard deviations: areas go with the determinant.
    along, across = factors[-1]
    ellipse = right.patches[-1]
    assert isinstance(ellipse, Ellipse)
    covariance = cells[-1].heard.bound.covariance
    assert ellipse.width * ellipse.height == pytest.approx(
        16.0 * along * across * math.sqrt(np.linalg.det(covariance))
    )


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"x([\d.]+)", text)]


@pytest.mark.parametrize("trials", [-1, 0, 1, 10**7])
def test_number_of_trials_is_checked(trials):
    with pytest.raises(ValueError, match=r"^trials: "):
        prepare_localization(trials=trials)
