from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import stats

from analysis.batches.distributions import Distribution
from systems.world.parameters import ObstacleParameters

COUNT = 4000
BOXES = {"count": [2, 4], "x_m": [1.0, 3.0], "y_m": [-1.0, 1.0], "side_m": [0.1, 0.5]}


def drawn(**distribution):
    generator = np.random.default_rng(7)
    model = Distribution.model_validate(distribution)
    return [value for _ in range(COUNT) for value in model.draw(generator)]


@pytest.mark.parametrize(
    ("distribution", "reference"),
    [
        ({"uniform": [-1.0, 3.0]}, stats.uniform(-1.0, 4.0)),
        ({"log_uniform": [0.1, 10.0]}, stats.loguniform(0.1, 10.0)),
        ({"normal": [2.0, 0.5]}, stats.norm(2.0, 0.5)),
    ],
)
def test_numbers_follow_their_law(distribution, reference):
    values = drawn(**distribution)
    assert stats.kstest(values, reference.cdf).pvalue > 0.01
    assert all(type(value) is float for value in values)


def test_integers_include_both_ends_and_are_even():
    values = drawn(integers=[-1, 2])
    assert all(type(value) is int for value in values)
    counts = [values.count(value) for value in (-1, 0, 1, 2)]
    assert sum(counts) == COUNT
    assert stats.chisquare(counts).pvalue > 0.01


def test_choice_gives_values_of_any_kind():
    values = drawn(choice=["a", [1, [2.5]], None])
    counts = [values.count(value) for value in ("a", [1, [2.5]], None)]
    assert sum(counts) == COUNT
    assert stats.chisquare(counts).pvalue > 0.01


def test_boxes_are_of_any_number_place_size_and_heading():
    generator = np.random.default_rng(7)
    model = Distribution.model_validate({"boxes": BOXES})
    lists = [model.draw(generator)[0] for _ in range(COUNT)]
    counts = [len(boxes) for boxes in lists]
    numbers = [counts.count(count) for count in (2, 3, 4)]
    assert sum(numbers) == COUNT
    assert stats.chisquare(numbers).pvalue > 0.01
    # The last one of each list: those before it are of all lists alike.
    last = [boxes[-1] for boxes in lists]
    columns = np.array(
        [[*b["waypoints_m"][0], b["heading_deg"], *b["size_m"]] for b in last]
    )
    spans = ((1.0, 2.0), (-1.0, 2.0), (-180.0, 360.0), (0.1, 0.4), (0.1, 0.4))
    for column, span in zip(columns.T, spans, strict=True):
        assert stats.kstest(column, stats.uniform(*span).cdf).pvalue > 0.01
    assert np.all(np.abs(np.corrcoef(columns.T) - np.eye(5)) < 0.06)
    assert [box["name"] for box in lists[0]][:2] == ["box 1", "box 2"]
    assert all(ObstacleParameters.model_validate(box) for box in lists[0])


def test_each_path_gets_its_own_line_of_the_number():
    pairs = [[1.0, 0.0], [-2.0, 1.0], [0.5, -3.0]]
    model = Distribution.model_validate({"uniform": [1.0, 2.0], "each": pairs})
    x, down, half = model.draw(np.random.default_rng(3), 3)
    assert (down, half) == pytest.approx((1.0 - 2.0 * x, 0.5 * x - 3.0))
    alone = Distribution.model_validate({"uniform": [1.0, 2.0]})
    assert alone.draw(np.random.default_rng(3), 2) == [x, x]


def test_either_sign_is_as_likely():
    values = np.array(drawn(uniform=[1.0, 2.0], either_sign=True))
    assert stats.kstest(np.abs(values), stats.uniform(1.0, 1.0).cdf).pvalue > 0.01
    positive = int(np.sum(values > 0.0))
    assert stats.binomtest(positive, COUNT).pvalue > 0.01


@pytest.mark.parametrize(
    ("distribution", "hint"),
    [
        ({}, "give one of uniform, log_uniform"),
        ({"uniform": [0, 1], "normal": [0, 1]}, "2 distributions"),
        ({"uniform": None}, "give one of"),
        ({"uniform": [2, 1]}, "low < high"),
        ({"uniform": [1, 1]}, "use set"),
        ({"uniform": [0, float("nan")]}, "finite"),
        ({"uniform": [0, float("inf")]}, "finite"),
        ({"uniform": [1]}, "required"),
        ({"uniform": ["a", 2]}, "number"),
        ({"log_uniform": [0, 1]}, "positive"),
        ({"normal": [1, 0]}, "positive"),
        ({"normal": [1, -2]}, "positive"),
        ({"integers": [3, 2]}, "low <= high"),
        ({"integers": [0.5, 2]}, "integer"),
        ({"integers": [0, 2**60]}, "less than"),
        ({"choice": []}, "at least 1"),
        ({"gamma": [1, 2]}, "not permitted"),
        ({"choice": [1, 2], "each": [[1, 0]]}, "each: applies to numbers"),
        ({"boxes": BOXES, "either_sign": True}, "either_sign: applies to numbers"),
        ({"uniform": [1, 2], "either_sign": False}, "True"),
        ({"uniform": [1, 2], "each": []}, "at least 1"),
        ({"boxes": BOXES, "uniform": [0, 1]}, "2 distributions"),
        ({"boxes": {**BOXES, "x_m": [2, 1]}}, "x_m: .*low <= high"),
        ({"boxes": {**BOXES, "count": [0, 101]}}, "less than or equal to 100"),
        ({"boxes": {**BOXES, "side_m": [0.0, 0.5]}}, "greater than"),
        ({"boxes": {"count": [1, 2]}}, "required"),
    ],
)
def test_impossible_distribution_is_refused(distribution, hint):
    with pytest.raises(ValidationError, match=hint):
        Distribution.model_validate(distribution)


def test_a_sector_is_evenly_filled():
    """Half of the area of a ring from 1 to 3 m lies within sqrt(5) m."""
    drawn = Distribution.model_validate(
        {
            "sector": {
                "about_m": [1.0, -2.0],
                "range_m": [1.0, 3.0],
                "bearing_deg": [0, 90],
            }
        }
    )
    generator = np.random.default_rng(1)
    x, y = np.array([drawn.draw(generator)[0] for _ in range(4000)]).T
    away, bearing = np.hypot(x - 1.0, y + 2.0), np.degrees(np.arctan2(y + 2.0, x - 1.0))
    assert away.min() >= 1.0
    assert away.max() <= 3.0
    assert np.mean(away < np.sqrt(5.0)) == pytest.approx(0.5, abs=0.03)
    assert bearing.min() >= 0.0
    assert np.mean(bearing < 45.0) == pytest.approx(0.5, abs=0.03)


def test_an_empty_sector_is_refused():
    data = {"sector": {"about_m": [0.0, 0.0], "range_m": [2.0, 1.0]}}
    with pytest.raises(ValidationError, match="is empty"):
        Distribution.model_validate(data)
