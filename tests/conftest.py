"""What holds for every test: no window, no silent number, no hidden chance."""

from __future__ import annotations

import os
from collections.abc import Iterator

import hypothesis
import numpy as np
import pytest

# An environment variable, so that subprocesses draw without a window too.
os.environ["MPLBACKEND"] = "Agg"

# The same examples on every machine; a busy machine is no failure. Examples are
# drawn from the numbers in the code, too: how many of them a test filters out
# must not decide whether an edit elsewhere passes.
hypothesis.settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    suppress_health_check=[
        hypothesis.HealthCheck.filter_too_much,
        hypothesis.HealthCheck.too_slow,
    ],
)
hypothesis.settings.load_profile("repeatable")


@pytest.fixture(autouse=True)
def raise_on_floating_point_errors() -> Iterator[None]:
    """Overflow, division by zero and NaN are errors.

    Underflow is not: a decaying exponential that ends at zero is right.
    """
    with np.errstate(all="raise", under="ignore"):
        yield


@pytest.fixture(autouse=True)
def forbid_global_numpy_generator() -> Iterator[None]:
    """Noise comes from a seed that somebody gave, never from numpy's own."""
    before = np.random.get_state(legacy=False)  # noqa: NPY002  # to see it untouched
    yield
    after = np.random.get_state(legacy=False)  # noqa: NPY002
    np.testing.assert_equal(
        after, before, err_msg="drawn from numpy's global generator; pass a seed"
    )
