"""Versions of the JSON documents, and of the packages that results depend on."""

from __future__ import annotations

import json
import os
import platform
import subprocess
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path

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


def made_by() -> str:
    """States when and by which version and commit a page is made.

    The date is that of ``SOURCE_DATE_EPOCH``, if this environment variable is set, so
    that pages can be made again byte by byte.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(epoch), UTC) if epoch.isdecimal() else None
    day = (now or datetime.now(UTC)).date().isoformat()
    commit = f", commit {_commit()}" if _commit() else ""
    return f"Made on {day} by phonotaxis {versions()['phonotaxis']}{commit}."


@cache
def _commit() -> str:
    """Returns the commit of the package's checkout or installation; empty: unknown."""
    root = Path(__file__).parents[2]
    with suppress(OSError, subprocess.SubprocessError):
        if (root / ".git").exists():
            words = ["git", "-C", str(root), "describe", "--always", "--dirty"]
            words += ["--exclude=*"]
            return subprocess.check_output(
                words, text=True, timeout=5, stderr=subprocess.DEVNULL
            ).strip()
    with suppress(PackageNotFoundError, ValueError, KeyError):
        told = distribution("phonotaxis").read_text("direct_url.json")
        return str(json.loads(told or "")["vcs_info"]["commit_id"])[:8]
    return ""
