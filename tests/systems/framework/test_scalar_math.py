"""The same numbers as Drake's functions, whatever they are given."""

from __future__ import annotations

import numpy as np
import pydrake.math
import pytest
from hypothesis import example, given, strategies as st
from pydrake.autodiffutils import AutoDiffXd

from systems.framework import scalar_math

pytestmark = pytest.mark.drake

NAMES = ("cos", "sin", "exp", "sqrt")


@pytest.mark.parametrize("name", NAMES)
@given(st.floats())
@example(-0.5)
@example(709.9)
def test_any_float(name, x):
    """Infinity, what is not a number, and what is too large among them."""
    ours, drakes = (getattr(m, name) for m in (scalar_math, pydrake.math))
    np.testing.assert_array_equal(ours(x), drakes(x))
    assert isinstance(ours(x), float)


SLOPES = {
    "cos": -np.sin(0.7),
    "sin": np.cos(0.7),
    "exp": np.exp(0.7),
    "sqrt": 0.5 / np.sqrt(0.7),
}


@pytest.mark.parametrize("name", NAMES)
def test_derivatives(name):
    value = getattr(scalar_math, name)(AutoDiffXd(0.7, 1, 0))
    assert value.value() == pytest.approx(getattr(np, name)(0.7))
    assert value.derivatives() == pytest.approx([SLOPES[name]])
