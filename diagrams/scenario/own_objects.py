"""Names of a user's functions and classes that a script or notebook passes as objects.

A scenario consists of plain values, so that a law or a block is a name in it. A
function at the top level of a module has the name ``package.module:Name``. Any other
function or class, for example of a notebook or a closure, exists only in this process.
Such an object gets a module of its own, whose name is a hash of the object.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib.machinery import PathFinder
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import Any

from diagrams.scenario.object_source import described, outside_values
from diagrams.scenario.own_code import is_in_memory, present_files
from systems.framework.input_error import InputError

_COUNT = count()
#: Text that identifies each object of this process, by the name of its module.
_SOURCES: dict[str, str] = {}


def name_of(own: Callable[..., Any]) -> str:
    """Returns the name by which a scenario refers to a function or class.

    The name of an object that exists only in this process belongs to the present state
    of the object: a copy of a function is kept, with the values that it uses.

    Args:
        own: Function or class, which is a law or a block.

    Returns:
        ``package.module:Name`` or ``path/to/file.py:Name``, or a name that is valid
        only in this process, see ``own_code.is_in_memory``.
    """
    return _name_in_file(own) or _name_in_memory(own)


def require_file(name: str, field: str, purpose: str) -> None:
    """Raises an ``InputError`` if a law or a block exists only in this process.

    ``field`` is the field that contains the name, and ``purpose`` is what needs a file.
    """
    if is_in_memory(name):
        own = name.partition(":")[2]
        raise InputError(
            field,
            f"{own!r} is an object of this process, and {purpose}; save it in "
            f"my_laws.py and give 'my_laws.py:{own}'",
        )


def source_in_memory(name: str) -> str:
    """Returns the source of an object that exists only in this process.

    See ``described``. The text is empty if this process has no object with this name.
    """
    return _SOURCES.get(name.partition(":")[0], "")


def with_names(value: Any) -> Any:
    """Replaces functions and classes in a tree of mappings and lists by their names."""
    if isinstance(value, Mapping):
        return {key: with_names(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [*map(with_names, value)]
    return name_of(value) if callable(value) else value


def _name_in_file(own: Any) -> str:
    """Returns the name of an object that another process can import, or an empty text.

    An object from before its module was loaded again has the name of its successor.
    """
    name = getattr(own, "__qualname__", "")
    module = sys.modules.get(getattr(own, "__module__", None) or "__main__")
    file = getattr(module, "__file__", None)
    if module is None or file is None or module.__name__ == "__main__":
        return ""
    found = vars(module).get(name)
    same = getattr(found, "__module__", None), getattr(found, "__qualname__", None)
    if found is not own and same != (module.__name__, name):
        return ""
    place = module.__name__ if _is_importable(module.__name__, file) else file
    return f"{place}:{name}"


def _is_importable(name: str, file: str) -> bool:
    """Whether Python finds the file if it imports a module by its name."""
    above = sys.modules.get(name.rpartition(".")[0])
    spec = None
    with suppress(ImportError, ValueError):
        spec = PathFinder.find_spec(name, getattr(above, "__path__", None))
    return spec is not None and Path(spec.origin or "") == Path(file)


def _name_in_memory(own: Any) -> str:
    kept, digest = _kept(own)
    name = getattr(own, "__name__", type(own).__name__).strip("<>")
    module_name = f"memory_{digest[:12]}"
    if module_name not in sys.modules:
        module = ModuleType(module_name)
        vars(module)[name] = kept
        sys.modules[module_name] = module
        _SOURCES[module_name] = described(own)
    return f"{module_name}:{name}"


def _kept(own: Any) -> tuple[Any, str]:
    """Returns an object to keep, and a hash of the object and of what it uses.

    Of a function, it is a copy, which later changes of global variables do not affect.
    """
    import cloudpickle  # only for objects of this process

    try:
        text = cloudpickle.dumps(own)
        kept = own if inspect.isclass(own) else cloudpickle.loads(text)
    except Exception:  # noqa: BLE001  # an object that cannot be pickled
        text, kept = f"object {next(_COUNT)}".encode(), own
    used = filter(None, map(_module_of, outside_values(own).values()))
    files = {file for module in used for file in present_files(module)}
    return kept, hashlib.sha256(text + repr(sorted(files)).encode()).hexdigest()


def _module_of(value: Any) -> ModuleType | None:
    if isinstance(value, ModuleType):
        return value
    return sys.modules.get(str(getattr(value, "__module__", None)))
