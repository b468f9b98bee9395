"""A user's own functions and classes, named in a scenario."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from systems.framework.input_error import InputError

__all__ = [
    "OURS",
    "asked_for",
    "files_of",
    "import_own",
    "made",
    "own_files",
    "why",
]

#: Packages of the project.
OURS = ("analysis", "diagrams", "systems")


def import_own(name: str, field: str) -> Any:
    """The function or class that a name stands for.

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
    except (Exception, SystemExit) as error:  # noqa: BLE001  # a user's module
        raise InputError(field, f"{name!r} cannot be imported: {why(error)}") from None
    if not callable(found):
        raise InputError(
            field, f"{module_name} has no function or class {attribute!r}; check it"
        )
    return found


def _import(name: str) -> ModuleType:
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
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[known] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[known]
        raise
    return module


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
    return files_of(_import(name.rpartition(":")[0]))


def files_of(module: ModuleType) -> tuple[Path, ...]:
    """Source files of a module of the user's, and of those of theirs that it uses.

    Args:
        module: Imported.

    Returns:
        Absolute paths in ascending order; none of a module that has no file.
    """
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        module = waiting.pop()
        file = getattr(module, "__file__", None)
        if module.__name__ in found or file is None or not _is_users(module, file):
            continue
        found[module.__name__] = Path(file).resolve()
        for value in list(vars(module).values()):
            owner = str(getattr(value, "__module__", None))
            used = value if isinstance(value, ModuleType) else sys.modules.get(owner)
            if isinstance(used, ModuleType):
                waiting.append(used)
    return tuple(sorted(found.values()))


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
    except (Exception, SystemExit) as error:  # whatever it raises
        raise InputError(
            field,
            f"{name!r} cannot be made ({why(error)}); it may ask for "
            f"{', '.join(parts)}",
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
    if module.__name__.partition(".")[0] in OURS:
        return False
    # The standard library, and what pip has installed.
    return (
        "site-packages" not in file and Path(sys.base_prefix) not in Path(file).parents
    )


def why(error: BaseException) -> str:
    """Kind and text of an error in a user's code, with its line."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = Path(__file__).resolve().parent
    own = [f for f in frames if ours not in Path(f.filename).resolve().parents]
    own = [f for f in own if "importlib" not in f.filename]
    at = f" in line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"{text}{at}"
