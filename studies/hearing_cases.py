"""Counts right and wrong answers of locate and listen in cases of public reports.

Each module of ``studies.support.hearing_cases`` holds the cases of one kind: ``TITLE``,
and ``cases()``, which lists them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np

from studies.support.hearing_cases.case import HearingCase
from studies.tables import Table

_KINDS = Path(__file__).parent / "support" / "hearing_cases"


def kinds() -> dict[str, tuple[str, list[HearingCase]]]:
    """Returns title and cases of each kind, by the name of its module."""
    found = {}
    for file in sorted(_KINDS.glob("*.py")):
        if file.stem not in ("__init__", "case"):
            module = import_module(f"studies.support.hearing_cases.{file.stem}")
            found[file.stem] = (module.TITLE, module.cases())
    return found


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options of this study."""
    parser.add_argument("--kind", help="only the kinds whose names contain this text")
    parser.add_argument("--case", help="only the cases whose names contain this text")


def run(options: argparse.Namespace) -> Iterator[Table]:
    """Yields the counts of all kinds, and then each case that was wrong."""
    wrong: list[Sequence[object]] = []
    heads = ("kind", "cases", "right", "wrong at a confidence above 0.5")
    yield Table("cases of hearing", heads, _counts(options, wrong))
    yield Table("wrong answers", ("kind", "case", "said"), wrong)


def _counts(
    options: argparse.Namespace, wrong: list[Sequence[object]]
) -> Iterator[Sequence[object]]:
    """Yields the counts of each kind and of all, and adds wrong cases to ``wrong``."""
    total = np.zeros(3, dtype=int)
    for name, (title, cases) in kinds().items():
        if options.kind and options.kind not in name:
            continue
        chosen = [c for c in cases if not options.case or options.case in c.name]
        outcomes = [(case, case.outcome()) for case in chosen]
        counts = [
            len(outcomes),
            sum(outcome.right for _, outcome in outcomes),
            sum(outcome.false_claim for _, outcome in outcomes),
        ]
        total += counts
        wrong += [[title, c.name, o.said] for c, o in outcomes if not o.right]
        yield [title, *counts]
    yield ["all", *total.tolist()]
