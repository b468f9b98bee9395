"""Bursts in reverberant rooms; docs/results_hearing.md has more of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from studies.rooms import ROOMS, SOUNDS, run_task
from studies.support import room_trials
from systems.sound.room import room_impulse_responses

pytestmark = pytest.mark.slow

LAYOUTS = 60


@pytest.fixture(scope="module", autouse=True)
def responses_once() -> Iterator[None]:
    """All sounds are played in the same layouts: most of the time goes to these."""
    compute = room_impulse_responses
    known: dict[tuple[object, ...], NDArray[np.float32]] = {}

    def remembered(room, p_WS, p_WM, c, *, images):
        key = (room.model_dump_json(), p_WS.tobytes(), p_WM.tobytes(), c)
        if key not in known:
            known[key] = compute(room, p_WS, p_WM, c, images=images)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room_trials, "room_impulse_responses", remembered)
        yield


@pytest.mark.parametrize("kind", SOUNDS)
@pytest.mark.parametrize("task", ROOMS)
def test_bursts_are_located(task, kind):
    """As often as is asked for, as far as so few layouts can tell."""
    assert run_task(task, kind, LAYOUTS).located_rate.high >= task.share


def test_precedence_is_what_does_it():
    """In the middle room, whole frames alone do not."""
    task = ROOMS[1]
    plain = run_task(task, "chirp", LAYOUTS, precedence=False)
    assert plain.located_rate.high < task.share
