"""Where compiled functions are kept, and for how long they hold.

numba keeps the code of a function until the file of that function changes. Most of our
compiled functions call functions of other files, whose code becomes part of theirs.
``njit`` below has numba keep code by the content of every file of ours that the
function's own file imports, directly or not. An edit in one of them is a new key; code
of other versions and of other clones stays beside it, until it was unused for 30 days.

None takes numba's ``fastmath``: sums that the compiler may reorder come out as the
machine, the caller and the order of compiling have it, and runs of 40 s make
centimetres of their last bit (``tests/evals/test_compiled_code.py``). Without it the
compiled loop by ear takes 10 to 15 % longer, Drake's 5 %.
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

#: Packages that code of ours is in.
_PACKAGES = ("systems", "diagrams", "analysis", "studies", "benchmarks")
_ROOT = Path(__file__).resolve().parents[2]
#: They tell numba how to compile functions of other files, which need not import them.
OVERLOADS = (
    _ROOT / "systems" / "framework" / "scalar_math.py",
    _ROOT / "systems" / "world" / "geometry.py",
)

#: The default folder. ``NUMBA_CACHE_DIR`` names another one.
_FOLDER = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "phonotaxis")
#: Code that was not used for so long is removed, s, ...
_KEPT_S = 30 * 86_400.0
#: ... and its last use is known to within a day, s.
_USE_S = 86_400.0

_IMPORT = re.compile(
    rb"^[ \t]*(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]+)|import\s+([\w., ]+))",
    re.MULTILINE,
)


def provide_cache(folder: Path = _FOLDER) -> Path | None:
    """Gives compiled code a folder where its usual one cannot be written.

    It lasts as long as the process, and serves the processes that this one starts.

    Args:
        folder: The usual one.

    Returns:
        A new folder; none where the usual one, or the user's choice, serves.
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
    """The folder of compiled code."""
    return Path(os.environ.get("NUMBA_CACHE_DIR") or _FOLDER)


def njit(*arguments: Any, **options: Any) -> Any:
    """``numba.njit``; code that it keeps holds for the present sources alone.

    Args:
        *arguments: Of ``numba.njit``.
        **options: Of ``numba.njit``.

    Returns:
        What ``numba.njit`` returns.
    """
    import numba  # only here: lists and refusals load this module, and no numba

    _keep_by_source()
    return numba.njit(*arguments, **options)


@cache
def _keep_by_source() -> None:
    """Has numba ask ``SourceLocator`` first, then those that it asks otherwise."""
    from numba import config
    from numba.core.caching import CacheImpl

    settings: Any = config
    others = settings.CACHE_LOCATOR_CLASSES or ",".join(
        each.__name__ for each in vars(CacheImpl)["_locator_classes"]
    )
    settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{SourceLocator.__name__},{others}"


class SourceLocator:
    """Tells numba where the code of one of our functions is kept.

    It has the methods of ``numba.core.caching._CacheLocator``.
    """

    def __init__(self, function: Any, file: str) -> None:
        self._py_file = file
        self._line = function.__code__.co_firstlineno
        self._digest = source_digest(Path(file))

    @classmethod
    def from_function(cls, function: Any, file: str) -> SourceLocator | None:
        """One for a function of ours, none for any other."""
        return cls(function, file) if _is_ours(Path(file)) else None

    def get_cache_path(self) -> str:
        """The folder of all functions of one file, by what they are made of."""
        name = f"{Path(self._py_file).stem}_{self._digest[:24]}"
        return str(cache_folder() / "functions" / name)

    def ensure_cache_path(self) -> None:
        """Makes the folder, and removes what was not used for long."""
        folder = Path(self.get_cache_path())
        if not folder.exists():
            _remove_unused(folder.parent)
            folder.mkdir(parents=True, exist_ok=True)

    def get_source_stamp(self) -> str:
        """What the code was compiled from."""
        folder = Path(self.get_cache_path())
        with suppress(OSError):
            if folder.stat().st_mtime < time.time() - _USE_S:
                os.utime(folder)
        return self._digest

    def get_disambiguator(self) -> str:
        """Line of the function: a file may have two of one name."""
        return str(self._line)


@cache
def _remove_unused(folder: Path) -> None:
    """Once per process."""
    oldest = time.time() - _KEPT_S
    with suppress(OSError):  # another process may remove them, too
        for each in folder.iterdir():
            if each.stat().st_mtime < oldest:
                shutil.rmtree(each, ignore_errors=True)


def source_digest(*files: Path) -> str:
    """Hash of Python files and of all sources of ours that they import.

    Those of ours are read once in a process: the code that it has loaded is that of its
    start.

    Args:
        *files: Of ours or a user's.

    Returns:
        Hexadecimal digits, the same for the same content in any clone.
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
    """Where it is in a clone; of a user's the name alone."""
    return str(file.relative_to(_ROOT)) if _is_ours(file) else file.name


def _read(file: Path) -> tuple[str, tuple[Path, ...]]:
    """Hash of a file, and the files of ours that it imports.

    Imports are taken from the text, in functions and comments as well: one too many
    costs a compilation, one too few a wrong result.
    """
    try:
        text = file.read_bytes()
    except OSError:  # a user's file that is gone, and still loaded
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
    """Whether files can be made there, or the folder itself."""
    while not folder.exists():
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK)


# Every import of a block comes by here, before numba compiles anything.
provide_cache()
