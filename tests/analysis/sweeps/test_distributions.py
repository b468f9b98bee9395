from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import stats

from analysis.sweeps.distributions import Distribution

COUNT = 4000


def drawn(**distribution):
    generator = np.random.default_rng(7)
    model = Distribution.model_validate(distribution)
    return [model.draw(generator) for _ in range(COUNT)]


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
    ],
)
def test_impossible_distribution_is_refused(distribution, hint):
    with pytest.raises(ValidationError, match=hint):
        Distribution.model_validate(distribution)
