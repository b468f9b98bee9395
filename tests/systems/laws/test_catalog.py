"""Every record of a law is whole, and true of the law's force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from systems.laws.catalog import LAWS, law_title

TUNED: dict[str, tuple[Any, Any]] = {
    law.name: (law, law.tuning) for law in LAWS.values() if law.tuning is not None
}
#: Least range of the sensors, and distances beyond it, m.
LEAST = 0.03
DISTANCES = np.linspace(LEAST, 3.0, 20_000)[1:]


def push(law, c, s, **changed):
    gains, *more = law.arguments(None, LEAST)
    gains = gains.model_copy(update=changed)
    return law.force(c, s, gains, *more)


def test_records_are_told_apart():
    for entry in ("title", "label"):
        assert len({getattr(law, entry) for law in LAWS.values()}) == len(LAWS)
    assert [law.name for law in LAWS.values()] == list(LAWS)
    assert all(
        law.force or law.controller or "searcher" in law.robot for law in LAWS.values()
    )
    assert all(law.equations for law in LAWS.values())


def test_titles():
    assert law_title("active2017") == "Active law of 2017"
    assert law_title("my_laws:soft") == "my_laws:soft"


@pytest.mark.parametrize("name", TUNED)
def test_loop_gains_are_those_of_the_two_terms(name):
    """Twice the gain, twice the push at rest, or twice what speed adds."""
    law, tuning = TUNED[name]
    gains = law.gains()
    assert law.loop_gains is not None
    spring, damper = ({g: 2.0 * getattr(gains, g)} for g in law.loop_gains)
    if tuning.rule == "matched":  # where the other gain that sets alpha, beta follows
        spring["matched_stiffness_n_m"] = 2.0 * gains.matched_stiffness_n_m
        damper["matched_damping_n_s_m"] = 2.0 * gains.matched_damping_n_s_m
    rest = tuning.spring_speed(gains)
    for c in (0.1, 0.4, 0.7):
        still = push(law, c, rest)
        assert push(law, c, rest, **spring) == pytest.approx(2.0 * still)
        moves = push(law, c, 0.3) - still
        twice = push(law, c, 0.3, **damper) - push(law, c, rest, **damper)
        assert twice == pytest.approx(2.0 * moves)
