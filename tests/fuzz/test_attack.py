"""Bad inputs of every kind end in a line a fault; thousands more: ``make attack``."""

from __future__ import annotations

import warnings

import pytest

from tests.fuzz.attack import attack
from tests.fuzz.attack_cases import KINDS, cases

COUNT, SEED = 54, 12


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_bad_input_ends_in_one_line(kind):
    wrong = []
    for case in cases(SEED, COUNT):
        if case.kind == kind:
            with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
                fault = attack(case)  # forks, and this process may have threads
            if fault:
                wrong.append((case.words, fault))
    assert wrong == []
