"""Where compiled functions are kept.

None takes numba's ``fastmath``: sums that the compiler may reorder come out as the
machine, the caller and the order of compiling have it, and runs of 40 s make
centimetres of their last bit (``tests/evals/test_compiled_code.py``). Without it the
compiled loop by ear takes 10 to 15 % longer, Drake's 5 %.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

__all__ = ["cache_folder", "provide_cache"]

#: Where numba keeps compiled code, best first.
_FOLDERS = (
    Path(__file__).with_name("__pycache__"),
    Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")),  # noqa: PTH111
)


def provide_cache(folders: Iterable[Path]) -> Path | None:
    """Gives numba a folder for compiled code where it would find none.

    It lasts as long as the process, and serves the processes that this one starts.
    Without any folder numba refuses to compile.

    Args:
        folders: Where numba would keep code, best first.

    Returns:
        A new folder; none where one of those can be written.
    """
    if os.environ.get("NUMBA_CACHE_DIR") or any(map(_can_be_written, folders)):
        return None
    made = Path(tempfile.mkdtemp(prefix="phonotaxis-numba-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = str(made)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(made)
    return made


def cache_folder() -> Path:
    """A folder for compiled code that can be written."""
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(given)
    return next(filter(_can_be_written, _FOLDERS))


def _can_be_written(folder: Path) -> bool:
    """Whether files can be made there, or the folder itself."""
    while not folder.exists():
        folder = folder.parent
    return os.access(folder, os.W_OK | os.X_OK)


# Every import of a block comes by here, before numba compiles anything.
provide_cache(_FOLDERS)
