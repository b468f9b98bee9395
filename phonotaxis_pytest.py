"""pytest fixtures for tests of blocks, laws and scenarios.

pytest loads this plugin in every environment in which phonotaxis is installed, also for
tests of other software. Therefore the module is no part of the package ``phonotaxis``,
and imports nothing but pytest. A fixture loads phonotaxis when a test uses it.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario


@pytest.fixture
def evaluate() -> Callable[..., dict[str, Any]]:
    """The function ``phonotaxis.testing.evaluate``: outputs of a block by port."""
    from phonotaxis.testing import evaluate

    return evaluate


@pytest.fixture
def quick_scenario() -> Callable[..., Scenario]:
    """A function that returns a scenario which runs in about a second.

    ``quick_scenario(name="default", **fields)`` loads a scenario with exact hearing and
    a duration of 2 s. ``fields`` are fields of the scenario to change, for example
    ``law="my_laws.py:soft"``. They also override the exact hearing and the duration.
    """
    from phonotaxis import load_scenario

    def make(name: str = "default", /, **fields: Any) -> Scenario:
        quick: dict[str, Any] = {"duration_s": 2.0}
        scenario = load_scenario(name)
        if any(robot.listens for robot in scenario.robots.values()):
            quick["hearing"] = "ideal"
        return scenario.with_(**{**quick, **fields})

    return make


@pytest.fixture
def seed(request: pytest.FixtureRequest) -> int:
    """A seed for random numbers. It depends only on the name of the test.

    A test has the same seed in every run and on every machine, and two tests have
    different seeds: ``quick_scenario(seed=seed)``.
    """
    return zlib.crc32(request.node.name.encode())
