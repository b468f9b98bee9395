"""Versions of the JSON documents, and of the packages that results depend on."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

#: Version of the JSON documents. It increases when a key changes its meaning.
SCHEMA_VERSION = 2
#: Packages that can change a result.
_PACKAGES = ("phonotaxis", "drake", "numpy", "scipy", "numba", "soxr", "soundfile")


def versions() -> dict[str, str]:
    """Returns the versions of Python and of all packages that can change a result."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
