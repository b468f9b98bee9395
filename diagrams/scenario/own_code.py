"""Imports a user's own functions and classes that a scenario names.

Python loads a module only once per process. However, a user may edit a law in a
notebook and run it again. Therefore ``import_own`` loads a module again if its file has
changed.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import re
import signal
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from systems.framework.input_error import InputError

if TYPE_CHECKING:
    pass

#: Names of objects that exist only in one process.
_IN_MEMORY = re.compile(r"memory_[0-9a-f]{12}:")

#: Packages of the project.
OURS = ("analysis", "diagrams", "phonotaxis", "systems")

#: Loaded modules of the user, with the contents of their files, by name of the module.
_LOADED: dict[str, tuple[ModuleType, bytes]] = {}
#: Whether loaded modules remain in use after a change, see ``pinned_code``.
_KEEPS = False


def import_own(name: str, field: str) -> Any:
    """Imports a user's function or class by its name.

    If the file of a module has changed since it was loaded, the function loads the
    module again. The same is true for the user's other modules that this module uses.

    Args:
        name: ``package.module:Name`` or ``path/to/file.py:Name``. Python also searches
            the working directory.
        field: Field of the scenario that contains the name, for messages.

    Returns:
        The function or class.

    Raises:
        InputError: The function or class does not exist, or its module cannot be
            imported.
    """
    module_name, _, attribute = name.rpartition(":")
    if not module_name or not attribute:
        raise InputError(
            field, f"{name!r} is not known; write package.module:Name or file.py:Name"
        )
    try:
        module = _import(module_name)
        found = getattr(module, attribute, None)
    except BaseException as error:  # a user's module may raise any exception
        if is_interrupt(error):
            raise
        if is_in_memory(name):
            raise InputError(
                field,
                f"{name!r} was an object of another process; copy it from own_code in "
                f"the result directory to my_laws.py and give 'my_laws.py:{attribute}'",
            ) from None
        raise InputError(field, f"{name!r} cannot be imported: {why(error)}") from None
    if not callable(found):
        raise InputError(
            field,
            f"{module_name} has no function or class {attribute!r}; check the name",
        )
    return found


def is_in_memory(name: str) -> bool:
    """Whether a law or a block is an object of one process, see ``name_of``."""
    return _IN_MEMORY.match(name) is not None


def _import(name: str) -> ModuleType:
    module = _module_of(name)
    changed = [each for each in _users_modules(module) if _has_changed(each)]
    if changed and not _KEEPS:
        _forget(changed)
        return _import(name)
    return module


def _module_of(name: str) -> ModuleType:
    """Returns a module, which is imported unless it is loaded already."""
    if not name.endswith(".py"):
        here = str(Path.cwd())
        if here not in sys.path:
            sys.path.append(here)
        return importlib.import_module(name)
    path = Path(name).expanduser().resolve()
    known = f"own_code_of_{path}"
    if known in sys.modules:
        return sys.modules[known]
    spec = importlib.util.spec_from_file_location(known, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[known] = module
    try:
        # Compile the source text. The bytecode cache cannot distinguish versions of a
        # file that have the same size and were saved in the same second.
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    except BaseException:
        del sys.modules[known]
        raise
    return module


def _has_changed(module: ModuleType) -> bool:
    """Whether a module's file has changed since loading. Records a new module."""
    text = _contents(_file_of(module))
    known, loaded = _LOADED.get(module.__name__, (None, b""))
    if known is not module:
        _LOADED[module.__name__] = module, text
        return False
    return text != loaded


def _contents(file: str) -> bytes:
    """Contents of a file; empty if the file is gone."""
    try:
        return Path(file).read_bytes()
    except OSError:
        return b""


def _forget(changed: Sequence[ModuleType]) -> None:
    """Unloads the user's changed modules, and the modules that use them."""
    gone = {
        name: module
        for name, (module, _) in _LOADED.items()
        if any(used in changed for used in _users_modules(module))
    }
    for name, module in gone.items():
        if sys.modules.get(name) is module:
            del sys.modules[name]
        if cached := getattr(module, "__cached__", None):
            with suppress(OSError):
                Path(cached).unlink(missing_ok=True)
        del _LOADED[name]
    importlib.invalidate_caches()


@contextmanager
def pinned_code(wanted: Mapping[str, str]) -> Iterator[None]:
    """Keeps loaded modules in use after a change, if they have the wanted versions.

    Args:
        wanted: SHA-256 of files, by absolute path. Without files, nothing is kept.

    Yields:
        Nothing.
    """
    global _KEEPS  # noqa: PLW0603
    loaded = {_file_of(module): _digest(text) for module, text in _LOADED.values()}
    kept = [wanted.get(file, digest) == digest for file, digest in loaded.items()]
    _KEEPS = bool(wanted) and all(kept)
    try:
        yield
    finally:
        _KEEPS = False


def own_files(name: str, field: str) -> tuple[Path, ...]:
    """Returns the files of a user's module, and of the user's modules that it uses.

    Args:
        name: Name of a law or a block.
        field: Field of the scenario that contains the name, for messages.

    Returns:
        Absolute paths in ascending order; none if the name belongs to the package.
    """
    if ":" not in name:
        return ()
    import_own(name, field)
    digests = digests_of(_module_of(name.rpartition(":")[0]))
    return tuple(sorted(map(Path, digests)))


def digests_of(module: ModuleType) -> dict[str, str]:
    """Returns digests of an imported module, and of the user's modules that it uses.

    The result is the SHA-256 of the loaded version of each file, by absolute path. It
    is empty if none of the files belongs to the user.
    """
    return {file: _digest(text) for file, text in _loaded_files(module).items()}


def _loaded_files(module: ModuleType) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    for each in _users_modules(module):
        _has_changed(each)  # records a new module
        files[_file_of(each)] = _LOADED[each.__name__][1]
    return files


def loaded_files(name: str) -> dict[str, bytes]:
    """Returns the files of a user's law or block, as they were when Python loaded them.

    Args:
        name: Name of a law or a block.

    Returns:
        Contents of the files of its module, and of the user's modules that it uses, by
        absolute path. There are none if the name belongs to the package, or if its
        module is not loaded.
    """
    if ":" not in name:
        return {}
    try:
        return _loaded_files(_module_of(name.rpartition(":")[0]))
    except BaseException as error:  # a user's module may raise any exception
        if is_interrupt(error):
            raise
        return {}


def present_files(module: ModuleType) -> dict[str, str]:
    """Returns digests of the present contents of the user's files of a module.

    The result is the SHA-256 by absolute path, like that of ``digests_of``.
    """
    files = map(_file_of, _users_modules(module))
    return {file: _digest(_contents(file)) for file in files}


def _digest(text: bytes) -> str:
    return hashlib.sha256(text).hexdigest()


def _imports(file: Path, package: str) -> list[str]:
    """Returns the names of the modules that the source code of a file imports.

    The objects in a loaded module do not suffice to find these names. For example, a
    number has no attribute ``__module__``, and does not show from which module it
    comes.
    """
    try:
        tree = ast.parse(file.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return []
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: 1 - node.level or None] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return names


def _file_of(module: ModuleType) -> str:
    """Absolute path of the file of a module."""
    return str(Path(module.__file__ or "").resolve())


def _users_modules(module: ModuleType) -> list[ModuleType]:
    """Returns a module and all modules that it uses, if they are files of the user."""
    found: dict[str, ModuleType] = {}
    waiting = [module]
    while waiting:
        module = waiting.pop()
        file = getattr(module, "__file__", None)
        if module.__name__ in found or file is None or not _is_users(module, file):
            continue
        found[module.__name__] = module
        # The module uses the modules that it imports or that define its objects.
        names = _imports(Path(file), module.__package__ or "")
        for value in list(vars(module).values()):
            of = "__name__" if isinstance(value, ModuleType) else "__module__"
            names.append(str(getattr(value, of, None)))
        used = map(sys.modules.get, names)
        waiting += [each for each in used if isinstance(each, ModuleType)]
    return [*found.values()]


def _is_users(module: ModuleType, file: str) -> bool:
    """Whether a module belongs to the user, and not to an installed package."""
    # The running script cannot be loaded again.
    if module.__name__.partition(".")[0] in (*OURS, "__main__"):
        return False
    # The standard library and installed packages are not the user's.
    return (
        "site-packages" not in file and Path(sys.base_prefix) not in Path(file).parents
    )


def is_interrupt(error: BaseException) -> bool:
    """Whether an exception comes from Ctrl-C, and not from a user's own code.

    The command line installs a signal handler that raises a subclass of
    KeyboardInterrupt. With this handler, a plain KeyboardInterrupt comes from the
    user's code. With Python's default handler, a plain KeyboardInterrupt counts as
    Ctrl-C.

    Args:
        error: An exception raised while a user's code ran.

    Returns:
        True if the exception comes from Ctrl-C.
    """
    if type(error) is not KeyboardInterrupt:
        return isinstance(error, KeyboardInterrupt)
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler


def why(error: BaseException) -> str:
    """Returns the kind, text and line of an error in a user's code."""
    frames = traceback.extract_tb(error.__traceback__)
    home = Path(__file__).resolve().parents[2]
    ours = {home / name for name in OURS}
    own = [f for f in frames if ours.isdisjoint(Path(f.filename).resolve().parents)]
    own = [f for f in own if "importlib" not in f.filename]
    at = f" in line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"{text}{at}"
