"""Bursts in reverberant rooms; docs/localization.md has more of them."""

from __future__ import annotations

import pytest

from benchmarks.rooms import ROOMS, SOUNDS, run_task

pytestmark = pytest.mark.slow

LAYOUTS = 60


@pytest.mark.parametrize("kind", SOUNDS)
@pytest.mark.parametrize("task", ROOMS)
def test_bursts_are_located(task, kind):
    """As often as is asked for, as far as so few layouts can tell."""
    assert run_task(task, kind, LAYOUTS).located_interval[1] >= task.share


def test_precedence_is_what_does_it():
    """In the middle room, whole frames alone do not."""
    task = ROOMS[1]
    plain = run_task(task, "chirp", LAYOUTS, precedence=False)
    assert plain.located_interval[1] < task.share
