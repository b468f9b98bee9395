"""A user's own functions and classes, named in a scenario.

Python reads a module once in a process. A user edits a law in a notebook and runs it
again: ``import_own`` compares the files with what was loaded, and loads them anew where
they differ.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import importlib.util
import inspect
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario

#: Packages of the project.
OURS = ("analysis", "diagrams", "phonotaxis", "systems")

#: Modules of a user's that are loaded, by name, and the SHA-256 of each one's file.
_LOADED: dict[str, tuple[ModuleType, str]] = {}
#: Whether modules stay as they were loaded, see ``code_of_sweep``.
_KEEPS = False


def import_own(name: str, field: str) -> Any:
    """The function or class that a name stands for.

    It is that of the present file: where the file of its module, or of a module of the
    user's that this one uses, has changed since it was loaded, they are loaded anew.

    Args:
        name: ``package.module:Name`` or ``path/to/file.py:Name``; both are looked
            up in the working directory, too.
        field: Of the scenario, which names it.

    Returns:
        What has that name; it can be called.

    Raises:
        InputError: There is none, or its module cannot be imported.
    """
    module_name, _, attribute = name.rpartition(":")
    if not module_name or not attribute:
        raise InputError(
            field, f"{name!r} is not known; write package.module:Name or file.py:Name"
        )
    try:
        module = _import(module_name)
        found = getattr(module, attribute, None)
    except BaseException as error:  # a user's module raises what it likes
        if is_interrupt(error):
            raise
        raise InputError(field, f"{name!r} cannot be imported: {why(error)}") from None
    if not callable(found):
        raise InputError(
            field,
            f"{module_name} has no function or class {attribute!r}; check the name",
        )
    return found


def _import(name: str) -> ModuleType:
    module = _module_of(name)
    changed = [each for each in _users_modules(module) if _has_changed(each)]
    if changed and not _KEEPS:
        _forget(changed)
        return _import(name)
    return module


def _module_of(name: str) -> ModuleType:
    """A module, that of an earlier call if there was one."""
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
        # From the text: bytecode that Python keeps is taken for that of a text of the
        # same size and second.
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    except BaseException:
        del sys.modules[known]
        raise
    return module


def _has_changed(module: ModuleType) -> bool:
    """Whether a module's file is not what was loaded; a new module is noted."""
    digest = _digest(Path(_file_of(module)))
    known, loaded = _LOADED.get(module.__name__, (None, ""))
    if known is not module:
        _LOADED[module.__name__] = module, digest
        return False
    return digest != loaded


def _digest(file: Path) -> str:
    """SHA-256 of a file; empty where it is gone."""
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError:
        return ""


def _forget(changed: Sequence[ModuleType]) -> None:
    """Has Python load modules of a user's anew, and those that use them."""
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


def loaded_digests(scenario: Scenario) -> dict[str, str]:
    """What a user's laws and blocks stand for, to tell versions of them apart.

    Args:
        scenario: Any; laws and blocks of the package have no files.

    Returns:
        SHA-256, as it was loaded, of each file of a user's that its robots use, by its
        absolute path.

    Raises:
        InputError: As ``import_own``.
    """
    digests: dict[str, str] = {}
    for robot in scenario.all_robots.values():
        names = [(robot.law, "law"), *((block, "blocks") for block in robot.blocks)]
        for name, field in names:
            if ":" in name:
                import_own(name, field)
                digests |= digests_of(_module_of(name.rpartition(":")[0]))
    return digests


@contextmanager
def code_of_sweep(scenario: Scenario, wanted: Mapping[str, str]) -> Iterator[None]:
    """Within it a process runs a scenario with the code with which its sweep began.

    What is loaded stays, whatever becomes of its file, as long as it is that code.

    Args:
        scenario: Any.
        wanted: SHA-256 of files by their absolute paths.

    Yields:
        Nothing.

    Raises:
        InputError: A file of a user's has changed, and this process has not loaded what
            it was.
    """
    global _KEEPS  # noqa: PLW0603
    loaded = {_file_of(module): digest for module, digest in _LOADED.values()}
    kept = [wanted.get(file, digest) == digest for file, digest in loaded.items()]
    _KEEPS = bool(wanted) and all(kept)
    try:
        own_law = any(":" in robot.law for robot in scenario.all_robots.values())
        for file, digest in loaded_digests(scenario).items():
            if wanted.get(file, digest) != digest:
                raise InputError(
                    "law" if own_law else "blocks",
                    f"{file} has changed since the sweep began; restore it, or begin a "
                    "new sweep",
                )
        yield
    finally:
        _KEEPS = False


def own_files(name: str, field: str) -> tuple[Path, ...]:
    """Source files of a module of the user's, and of those of theirs that it uses.

    Args:
        name: Of a law or a block; those of the package have none.
        field: Of the scenario, which names it.

    Returns:
        Absolute paths in ascending order; none for a name of the package.
    """
    if ":" not in name:
        return ()
    import_own(name, field)
    digests = digests_of(_module_of(name.rpartition(":")[0]))
    return tuple(sorted(map(Path, digests)))


def digests_of(module: ModuleType) -> dict[str, str]:
    """A module of the user's, and those of theirs that it uses, as they were loaded.

    Args:
        module: Imported.

    Returns:
        SHA-256 of each file by its absolute path; none of a module that has no file.
    """
    digests: dict[str, str] = {}
    for each in _users_modules(module):
        _has_changed(each)  # notes one that was not known
        digests[_file_of(each)] = _LOADED[each.__name__][1]
    return digests


def _imports(file: Path, package: str) -> list[str]:
    """Names of the modules that a file imports: of a number none tells whence it is."""
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
    """Absolute path."""
    return str(Path(module.__file__ or "").resolve())


def _users_modules(module: ModuleType) -> list[ModuleType]:
    """It, and those that it uses, as far as they are files of the user's."""
    found: dict[str, ModuleType] = {}
    waiting = [module]
    while waiting:
        module = waiting.pop()
        file = getattr(module, "__file__", None)
        if module.__name__ in found or file is None or not _is_users(module, file):
            continue
        found[module.__name__] = module
        names = _imports(Path(file), module.__package__ or "")
        for value in list(vars(module).values()):
            of = "__name__" if isinstance(value, ModuleType) else "__module__"
            names.append(str(getattr(value, of, None)))
        used = map(sys.modules.get, names)
        waiting += [each for each in used if isinstance(each, ModuleType)]
    return [*found.values()]


def made(
    name: str, field: str, maker: Callable[..., Any], parts: Mapping[str, Any]
) -> Any:
    """What a user's class makes of what its arguments ask for.

    Args:
        name: Of the class, for messages.
        field: Of the scenario, which names it.
        maker: The class; of a scalar-templated one its ``_construct`` tells what it
            asks for.
        parts: What it may ask for, by name; it gets all, where it takes any keyword.

    Returns:
        The object.

    Raises:
        InputError: It cannot be made.
    """
    try:
        return maker(**asked_for(maker, parts))
    except BaseException as error:  # a user's class raises what it likes
        if is_interrupt(error):
            raise
        raise InputError(
            field,
            f"{name!r} cannot be made ({why(error)}); it may take {', '.join(parts)}",
        ) from error


def asked_for(maker: Callable[..., Any], parts: Mapping[str, Any]) -> dict[str, Any]:
    """Those of some parts that a class asks for.

    Args:
        maker: The class, as of ``made``.
        parts: By name.

    Returns:
        Those that its arguments name; all, where it takes any keyword.
    """
    asked = inspect.signature(getattr(maker, "_construct", maker)).parameters
    if any(each.kind is each.VAR_KEYWORD for each in asked.values()):
        return dict(parts)
    return {key: parts[key] for key in asked if key in parts}


def _is_users(module: ModuleType, file: str) -> bool:
    """Whether versions of packages do not tell what the module holds."""
    # A script that runs cannot be loaded anew.
    if module.__name__.partition(".")[0] in (*OURS, "__main__"):
        return False
    # The standard library, and what pip has installed.
    return (
        "site-packages" not in file and Path(sys.base_prefix) not in Path(file).parents
    )


def is_interrupt(error: BaseException) -> bool:
    """Whether Ctrl-C may have raised an exception, and not a user's own code.

    The command line has a handler for Ctrl-C that raises a class of its own, so that a
    plain KeyboardInterrupt comes from the user's code. Python's default handler raises
    that same plain KeyboardInterrupt: there it counts as Ctrl-C.

    Args:
        error: Raised while a user's code ran.
    """
    if type(error) is not KeyboardInterrupt:
        return isinstance(error, KeyboardInterrupt)
    return signal.getsignal(signal.SIGINT) is signal.default_int_handler


def why(error: BaseException) -> str:
    """Kind and text of an error in a user's code, with its line."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = Path(__file__).resolve().parents[1]
    own = [f for f in frames if ours not in Path(f.filename).resolve().parents]
    own = [f for f in own if "importlib" not in f.filename]
    at = f" in line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"{text}{at}"
