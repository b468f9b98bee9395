"""The words of a comparison: checked before what simulates is loaded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import diagrams
from analysis.sweeps.sweep_file import read_sweep, sweep_schema
from diagrams.fields import check_structure, known_laws, unknown_law
from diagrams.loading import parse_setting, read_fields
from systems.framework.input_error import InputError

__all__ = [
    "EXPERIMENTS",
    "VELOCITY_TERM",
    "check_words",
    "library_layouts",
    "listed_values",
    "whole_seed",
]

#: The papers' experiments.
EXPERIMENTS = (
    "obstacle_free",
    "two_static_obstacles",
    "one_moving_obstacle",
    "two_moving_obstacles",
)
VELOCITY_TERM = "repulsion.velocity_term"
_LIBRARY = Path(diagrams.__file__).parent / "layouts"


def library_layouts() -> dict[str, Path]:
    """Names and files of the layouts that come with the package."""
    return {path.stem: path for path in sorted(_LIBRARY.glob("*.yaml"))}


def check_words(
    scenarios: Sequence[str],
    *,
    laws: str | None,
    velocity_terms: str | None,
    runs: int,
    seed: str | None,
    settings: Iterable[str],
    grid: Iterable[str],
) -> None:
    """Finds what is wrong with single words.

    Args:
        scenarios: As of ``comparison_plans``.
        laws: As of ``comparison_plans``.
        velocity_terms: As of ``comparison_plans``.
        runs: As of ``comparison_plans``.
        seed: As of ``comparison_plans``.
        settings: As of ``comparison_plans``.
        grid: As of ``comparison_plans``.

    Raises:
        InputError: A scenario or a law is unknown, or another word is wrong.
    """
    whole_seed(seed)
    for text in grid:
        listed_values(text)
    for law in laws.split(",") if laws is not None else ():
        if ":" not in law and law not in known_laws():
            raise unknown_law(law, known_laws())
    check_structure({"runs": runs}, sweep_schema(), "a comparison")
    terms = velocity_terms.split(",") if velocity_terms is not None else ()
    settings, library = list(settings), library_layouts()
    for term in terms:
        read_fields("default", [f"{VELOCITY_TERM}={term}"])
    for name in scenarios or EXPERIMENTS:
        if name not in library:
            if not Path(name).is_file():
                read_fields(name, settings)
        elif settings:
            read_fields(read_sweep(library[name])["scenario"], settings)


def listed_values(text: str) -> tuple[str, list[Any]]:
    """Key and values of ``key=[value, ...]``.

    Args:
        text: A word of ``--grid``.

    Returns:
        Dotted path, and plain values.

    Raises:
        InputError: It is not of that form.
    """
    key, values = parse_setting(text)
    if not isinstance(values, list):
        raise InputError(key, f"{values!r} is no list of values; write [a, b]")
    return key, values


def whole_seed(text: str | None) -> int:
    """The number that a word stands for.

    Args:
        text: A word of ``--seed``; none: 1.

    Returns:
        0 or more.

    Raises:
        InputError: It is no such number.
    """
    if text is None:
        return 1
    if not text.isdigit():
        raise InputError("seed", f"{text!r} is not a whole number; give 0 or more")
    return int(text)
