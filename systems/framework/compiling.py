"""Manages the cache of functions that numba compiles.

By default, numba reuses the cached code of a function until the file with this function
changes. However, the compiled code of most functions contains code from other files.
Therefore the function ``njit`` below uses its own cache key. The key is a hash of the
file and of all files of this repository that the file imports, directly or indirectly.
If one of these files changes, the function is compiled again. The cache also keeps the
code of other versions and other clones, until nobody has used it for 30 days.

No function uses the option ``fastmath`` of numba. With this option, the compiler may
reorder sums. The last bit of a sum would then depend on the machine, on the caller and
on the order of compilation. In a run of 40 s, this difference grows to centimeters
(``tests/evals/test_compiled_code.py``). The exact order of sums costs time. It slows
the compiled simulation loop of a robot that listens by 10 to 15 %, and the loop of
Drake by 5 %.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

#: The packages of this repository.
_PACKAGES = ("systems", "diagrams", "analysis", "studies", "benchmarks")
_ROOT = Path(__file__).resolve().parents[2]
#: Files that define how numba compiles functions of other files. The other files need
#: not import them. Therefore every digest includes these files.
OVERLOADS = (
    _ROOT / "systems" / "framework" / "scalar_math.py",
    _ROOT / "systems" / "world" / "geometry.py",
)

#: The default folder of the cache. ``NUMBA_CACHE_DIR`` overrides it.
_FOLDER = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "phonotaxis")
#: Time without use after which code is removed, s.
_KEPT_S = 30 * 86_400.0
#: Resolution of the recorded time of the last use, s.
_USE_S = 86_400.0

_IMPORT = re.compile(
    rb"^[ \t]*(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]+)|import\s+([\w., ]+))",
    re.MULTILINE,
)


def provide_cache(folder: Path = _FOLDER) -> Path | None:
    """Creates a temporary cache folder if the usual folder is not writable.

    This process and its child processes use the temporary folder. It is removed when
    the process ends.

    Args:
        folder: The usual folder of the cache.

    Returns:
        The temporary folder. None if the usual folder is writable, or if the user has
        set ``NUMBA_CACHE_DIR``.
    """
    if os.environ.get("NUMBA_CACHE_DIR") or _can_be_written(folder):
        return None
    made = Path(tempfile.mkdtemp(prefix="phonotaxis-numba-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = str(made)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(made)
    return made


def cache_folder() -> Path:
    """Returns the folder of the compiled code."""
    return Path(os.environ.get("NUMBA_CACHE_DIR") or _FOLDER)


def njit(*arguments: Any, **options: Any) -> Any:
    """Calls ``numba.njit``, with a cache key for the source file and all its imports.

    Args:
        *arguments: Positional arguments of ``numba.njit``.
        **options: Options of ``numba.njit``.

    Returns:
        The result of ``numba.njit``.
    """
    import numba  # imported late, because lists and error messages need no numba

    _keep_by_source()
    return numba.njit(*arguments, **options)


@cache
def _keep_by_source() -> None:
    """Makes ``SourceLocator`` the first of the cache locators of numba."""
    from numba import config
    from numba.core.caching import CacheImpl

    settings: Any = config
    others = settings.CACHE_LOCATOR_CLASSES or ",".join(
        each.__name__ for each in vars(CacheImpl)["_locator_classes"]
    )
    settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{SourceLocator.__name__},{others}"


class SourceLocator:
    """Tells numba where to cache the code of a function, and with which key.

    The class has the methods of ``numba.core.caching._CacheLocator``.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._py_file = file
        self._line = function.__code__.co_firstlineno
        self._digest = source_digest(Path(file))

    @classmethod
    def from_function(cls, function: Any, file: str) -> SourceLocator | None:
        """Returns a locator for one of our functions, and None for other functions."""
        return cls(function, file) if _is_ours(Path(file)) else None

    def get_cache_path(self) -> str:
        """Returns the folder for the functions of the file and its present digest."""
        name = f"{Path(self._py_file).stem}_{self._digest[:24]}"
        return str(cache_folder() / "functions" / name)

    def ensure_cache_path(self) -> None:
        """Creates the folder if necessary, and removes folders that are long unused."""
        folder = Path(self.get_cache_path())
        if not folder.exists():
            _remove_unused(folder.parent)
            folder.mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        """Returns the digest of the sources, and records the use of the folder."""
        folder = Path(self.get_cache_path())
        with suppress(OSError):
            if folder.stat().st_mtime < time.time() - _USE_S:
                os.utime(folder)
        return self._digest

    def get_disambiguator(self) -> str:
        """Returns the line, because a file may have two functions of the same name."""
        return str(self._line)


@cache
def _remove_unused(folder: Path) -> None:
    """Removes folders without recent use, at most once per process."""
    oldest = time.time() - _KEPT_S
    with suppress(OSError):  # another process may remove the same folders
        for each in folder.iterdir():
            if each.stat().st_mtime < oldest:
                shutil.rmtree(each, ignore_errors=True)


def source_digest(*files: Path) -> str:
    """Computes a hash of Python files and of all files of this repository they import.

    A process reads each file of this repository only once, because later changes do not
    affect the code that is loaded.

    Args:
        *files: Files of this repository, or files of a user.

    Returns:
        Hexadecimal digits. They depend on the content of the files, not on the folder
        of the repository.
    """
    import numpy as np

    found: dict[Path, str] = {}
    waiting = [*files, *OVERLOADS]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found[file], imported = (_read_once if _is_ours(file) else _read)(file)
            waiting += imported
    texts = sorted(f"{_place(file)} {text}" for file, text in found.items())
    return hashlib.sha256("\n".join([np.__version__, *texts]).encode()).hexdigest()


def _place(file: Path) -> str:
    """Returns the path of our file within a clone, or the name of a user's file."""
    return str(file.relative_to(_ROOT)) if _is_ours(file) else file.name


def _read(file: Path) -> tuple[str, tuple[Path, ...]]:
    """Returns the hash of a file, and the files of this repository that it imports.

    A text search finds the imports, even those in functions and in comments. A
    superfluous file costs only a compilation, but a missing file would give wrong
    results.
    """
    try:
        text = file.read_bytes()
    except OSError:  # a deleted file of a user whose code is still loaded
        text = b""
    names: set[str] = set()
    for base, listed, plain in _IMPORT.findall(text):
        if base:
            names.add(base.decode())
            parts = re.findall(rb"\w+", re.sub(rb"#.*", b"", listed))
            names |= {f"{base.decode()}.{part.decode()}" for part in parts}
        names |= {each.split()[0] for each in plain.decode().split(",") if each.strip()}
    return hashlib.sha256(text).hexdigest(), tuple(_files_of(names))


_read_once = cache(_read)


def _files_of(names: Iterable[str]) -> Iterator[Path]:
    for name in sorted(names):
        if name.partition(".")[0] in _PACKAGES:
            path = _ROOT / name.replace(".", "/")
            for file in (path.with_suffix(".py"), path / "__init__.py"):
                if file.is_file():
                    yield file


@cache
def _is_ours(file: Path) -> bool:
    return any(_ROOT / package in file.parents for package in _PACKAGES)


def _can_be_written(folder: Path) -> bool:
    """Returns whether the folder is writable or can be created."""
    while not folder.exists():
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK)


# Every block imports this module before numba compiles anything.
provide_cache()
