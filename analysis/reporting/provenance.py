"""What a result rests on: versions, and the meaning of its document's keys."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

#: Raised when a key of the JSON documents changes its meaning.
SCHEMA_VERSION = 1
#: Packages that can change a result.
_PACKAGES = ("phonotaxis", "drake", "numpy", "scipy", "numba", "soxr", "soundfile")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that can change a result."""
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
