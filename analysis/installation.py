"""Checks of the installation, with a remedy for each fault."""

from __future__ import annotations

import importlib
import os
import platform
import shutil
import sys
import webbrowser
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

#: Least free space on the disk, MB. The files of a run take some MB, and compiled code
#: takes some hundred MB.
LEAST_FREE_MB = 500
#: Packages, each with a module. If the module can be loaded, the package works.
_PACKAGES = {
    "drake": "pydrake.systems.framework",
    "numpy": "numpy",
    "numba": "numba",
    "scipy": "scipy.fft",
    "rocket-fft": "rocket_fft",
    "pandas": "pandas",
    "pyarrow": "pyarrow",
    "pydantic": "pydantic",
    "pyroomacoustics": "pyroomacoustics",
    "soundfile": "soundfile",
    "matplotlib": "matplotlib",
}
_ROOT = Path(__file__).resolve().parents[1]
_BROWSERS = ("chromium", "google-chrome", "chromium-browser", "firefox")


@dataclass(frozen=True)
class Diagnosis:
    """Result of the check of one part of the installation."""

    name: str
    verdict: Literal["ok", "note", "bad"]
    """``ok``: the part works. ``note``: an optional part is missing. ``bad``: runs
    would fail."""
    found: str
    remedy: str = ""
    """Advice to the user; empty if nothing needs to be done."""


def examine() -> list[Diagnosis]:
    """Checks everything that runs need, and some optional parts.

    Returns:
        One result for each checked part.
    """
    return [
        _python(),
        *(_package(name, module) for name, module in _PACKAGES.items()),
        _compiled_code(),
        _free_disk(),
        _sound_card(),
        _browser(),
    ]


def _python() -> Diagnosis:
    good = sys.version_info >= (3, 11)
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    remedy = "" if good else "install Python 3.11 or newer"
    return Diagnosis("python", "ok" if good else "bad", found, remedy)


def _package(name: str, module: str) -> Diagnosis:
    again = f"install it again: pip install --force-reinstall {name}"
    try:
        number = version(name)
        importlib.import_module(module)
    except PackageNotFoundError:
        return Diagnosis(name, "bad", "is not installed", f"pip install {name}")
    except (ImportError, OSError) as error:
        return Diagnosis(name, "bad", f"{number}, but does not load: {error}", again)
    return Diagnosis(name, "ok", number)


def _compiled_code() -> Diagnosis:
    from systems.framework.compiling import cache_folder

    folder = cache_folder()
    files = [*folder.glob("**/*.nb[ci]")]
    size_mb = sum(file.stat().st_size for file in files) / 1e6
    found = f"{len(files)} files, {size_mb:.0f} MB, in {folder}"
    remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
    if folder.name.startswith("phonotaxis-numba-"):
        return Diagnosis("compiled code", "note", "is not kept in any folder", remedy)
    if not os.access(next(p for p in (folder, *folder.parents) if p.exists()), os.W_OK):
        return Diagnosis("compiled code", "bad", f"{found}, read-only", remedy)
    return Diagnosis("compiled code", "ok", found)


def _free_disk() -> Diagnosis:
    free_mb = shutil.disk_usage(Path.cwd()).free / 1e6
    found = f"{free_mb / 1e3:.1f} GB free here"
    if not os.access(Path.cwd(), os.W_OK):
        remedy = "change to a directory that can be written, or use --out"
        return Diagnosis("disk", "note", f"{found}, but read-only", remedy)
    if free_mb < LEAST_FREE_MB:
        return Diagnosis("disk", "bad", found, f"make {LEAST_FREE_MB} MB free")
    return Diagnosis("disk", "ok", found)


def _sound_card() -> Diagnosis:
    try:
        sounddevice = importlib.import_module("sounddevice")
    except (ImportError, OSError) as error:
        return Diagnosis(
            "sound card",
            "note",
            f"cannot be queried ({error})",
            "phonotaxis listen takes a pipe; for a card: pip install 'phonotaxis[live]'"
            " and PortAudio",
        )
    inputs = [
        each for each in sounddevice.query_devices() if each["max_input_channels"]
    ]
    if not inputs:
        remedy = "phonotaxis listen takes a pipe"
        return Diagnosis("sound card", "note", "none that records", remedy)
    most = max(inputs, key=_channels)
    return Diagnosis("sound card", "ok", f"{most['name']}, {_channels(most)} channels")


def _channels(device: dict[str, int]) -> int:
    return device["max_input_channels"]


def _browser() -> Diagnosis:
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        try:
            found = webbrowser.get().name
        except webbrowser.Error:
            return Diagnosis(
                "browser",
                "note",
                "none found",
                "copy replay.html and reports to a computer that has one",
            )
    return Diagnosis("browser", "ok", found)
