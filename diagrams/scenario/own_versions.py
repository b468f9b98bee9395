"""Versions of the user's own laws and blocks that a scenario uses."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from diagrams.scenario.own_code import import_own, loaded_files, pinned_code
from diagrams.scenario.scenario import Scenario
from systems.framework.input_error import InputError


def loaded_digests(scenario: Scenario) -> dict[str, str]:
    """Returns digests of a user's own laws and blocks, to identify their versions.

    Args:
        scenario: Any scenario. The function ignores laws and blocks of the package.

    Returns:
        SHA-256 of each file of the user that the robots use, by absolute path. If a
        file has changed since Python loaded it, the digest is that of the loaded
        version.

    Raises:
        InputError: A law or block cannot be imported, see ``import_own``.
    """
    digests: dict[str, str] = {}
    for robot in scenario.robots.values():
        for name, field in robot.own_code.items():
            import_own(name, field)
            for file, text in loaded_files(name).items():
                digests[file] = hashlib.sha256(text).hexdigest()
    return digests


@contextmanager
def code_of_sweep(scenario: Scenario, wanted: Mapping[str, str]) -> Iterator[None]:
    """Ensures that a scenario runs with the user's code from the start of a sweep.

    A sweep is a series of runs. Within the context, a changed file is not loaded again
    if all loaded code is from the start of the sweep.

    Args:
        scenario: The scenario to run.
        wanted: SHA-256 of each file at the start of the sweep, by absolute path.

    Yields:
        Nothing.

    Raises:
        InputError: A user's file has changed, and this process has not loaded the
            version from the start of the sweep.
    """
    own_law = any(":" in robot.law for robot in scenario.robots.values())
    with pinned_code(wanted):
        for file, digest in loaded_digests(scenario).items():
            if wanted.get(file, digest) != digest:
                raise InputError(
                    "law" if own_law else "blocks",
                    f"{file} has changed since the sweep began; restore it, or begin a "
                    "new sweep",
                )
        yield
