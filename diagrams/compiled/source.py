"""Generated source, compiled by numba once for all processes.

numba keeps compiled code for functions of files, by the types of their arguments. So
the source is written into a file beside that code, whose name tells all that the code
depends on; and what numbers cannot be, functions and named tuples, stands in it as
names, while all numbers come as a few arrays.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import sys
import time
from collections import namedtuple
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property
from itertools import count
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba import njit
from numba.extending import register_jitable

from diagrams.own_code import OURS, files_of
from systems.framework.compiling import cache_folder
from systems.framework.parameters import Parameters

__all__ = ["PACKED", "Packing", "compiled_from"]

#: Arguments by which a generated function takes the values of a ``Packing``.
PACKED = "floats, ints, flags, vectors, others"

#: Generated files that were not used for so long are removed, s.
_KEPT_S = 30 * 86_400.0

_LOGGER = logging.getLogger("phonotaxis")
_COUNT = count()


class Packing:
    """Values as a generated function gets them."""

    def __init__(self) -> None:
        self.names: dict[str, Any] = {}
        """Functions and named tuples, by their names in the source."""
        self._lists: dict[str, list[Any]] = {name: [] for name in PACKED.split(", ")}
        self._arrays: dict[int, tuple[Any, str]] = {}

    @property
    def values(self) -> tuple[Any, ...]:
        """What ``PACKED`` stands for."""
        floats, ints, flags, vectors, others = self._lists.values()
        return (
            np.array(floats, dtype=float),
            np.array(ints, dtype=np.int64),
            np.array(flags, dtype=bool),
            np.array(vectors, dtype=float),
            tuple(others),
        )

    def expression(self, value: Any) -> str:
        """A value as source text.

        Args:
            value: A number, an array, a function, a tuple of values, or parameters,
                which become a named tuple of their fields and of what they derive from
                them; lists become arrays (an empty one is of pairs), what is unset
                becomes 0.
        """
        if isinstance(value, Parameters):
            kind = _tuple_type(type(value))
            return self._call(kind, [getattr(value, name) for name in kind._fields])
        if isinstance(value, tuple):
            return self._call(type(value), value)
        if callable(value):
            return self.name(getattr(value, "py_func", value))
        if isinstance(value, list):
            value = np.array(value) if value else np.empty((0, 2))
        for kind, place in ((bool, "flags"), (int, "ints"), (float, "floats")):
            if type(value) is kind:
                return self._place(place, value)
        if value is None:
            return self._place("floats", 0.0)
        return self._array(value)

    def name(self, function: Any) -> str:
        """Name of a function or class; a function is compiled for the loop."""
        known = (
            _compilable(function) if isinstance(function, FunctionType) else function
        )
        for name, value in self.names.items():
            if value is known:
                return name
        # A lambda's name stands in brackets.
        name = f"{known.__name__.strip('<>')}_{len(self.names)}"
        self.names[name] = known
        return name

    def _call(self, kind: type, values: Any) -> str:
        text = "".join(f"{self.expression(value)}, " for value in values)
        return f"{self.name(kind)}({text})" if hasattr(kind, "_fields") else f"({text})"

    def _place(self, place: str, value: Any) -> str:
        self._lists[place].append(value)
        return f"{place}[{len(self._lists[place]) - 1}]"

    def _array(self, value: Any) -> str:
        """An array stands there once; vectors of floats all in one.

        Each array would come as seven arguments, hundreds of which take numba minutes.
        """
        if id(value) not in self._arrays:
            if (
                isinstance(value, np.ndarray)
                and value.ndim == 1
                and value.dtype == float
            ):
                # Its length is no part of the source: one serves all layouts.
                vectors = self._lists["vectors"]
                begin = self._place("ints", len(vectors))
                vectors += value.tolist()
                text = f"vectors[{begin}:{self._place('ints', len(vectors))}]"
            else:
                text = self._place("others", value)
            self._arrays[id(value)] = value, text
        return self._arrays[id(value)][1]


@cache
def _tuple_type(model: type[Parameters]) -> Any:
    derived = [
        name
        for each in reversed(model.__mro__)
        for name, value in vars(each).items()
        if isinstance(value, cached_property)
    ]
    return namedtuple(f"{model.__name__}Numbers", [*model.model_fields, *derived])


@cache
def _compilable(function: FunctionType) -> Any:
    """A function for compiled code, without what checks it for Drake's sake.

    Known to numba by its type alone: a compiled function within a named tuple would
    be a pointer, and code with pointers is not kept.
    """
    return register_jitable(inspect.unwrap(function))


def compiled_from(source: str, names: Mapping[str, Any]) -> Any:
    """The function ``loop`` of generated source, compiled when it is first called.

    Args:
        source: Defines ``loop``.
        names: What its names stand for.

    Returns:
        The function; the same one for the same source and names.
    """
    return _loaded(source, tuple(names.items()))


@cache
def _loaded(source: str, named: tuple[tuple[str, Any], ...]) -> Any:
    file = _file(source, dict(named))
    if file is None or not any((file.parent / "__pycache__").glob(f"{file.stem}.*")):
        _LOGGER.info("compiling this kind of scenario, for some 15 s ...")
    # numba asks for the module of what it loads; loops without a file are not one.
    name = file.stem if file else f"loop_{next(_COUNT)}"
    module = ModuleType(f"phonotaxis.{name}")
    sys.modules[module.__name__] = module
    vars(module).update(named)
    exec(compile(source, str(file or "<loop>"), "exec"), vars(module))
    return njit(cache=file is not None)(module.loop)


def _file(source: str, names: Mapping[str, Any]) -> Path | None:
    """A file of the source; none where its names do not tell what it does.

    Its own name is a hash of all that compiled code depends on.
    """
    origins = (
        [*map(str, _origins(names))] if all(map(_is_known, names.values())) else []
    )
    if not origins:
        return None
    text = "".join([*(f"# {line}\n" for line in (*origins, _digest())), source])
    folder = cache_folder() / "phonotaxis_loops"
    file = folder / f"loop_{hashlib.sha256(text.encode()).hexdigest()[:24]}.source"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if file.exists():
            file.touch()
        else:
            _remove_unused(folder)
            partial = file.with_suffix(f".{time.time_ns()}.part")
            partial.write_text(text, encoding="utf-8")
            partial.replace(file)
    except OSError:
        return None
    return file


def _is_known(value: Any) -> bool:
    """Whether the files that define a function decide what it does."""
    function = getattr(value, "py_func", value)
    if isinstance(function, FunctionType) and function.__closure__:
        return False
    return bool(_files(function))


def _files(function: Any) -> tuple[Path, ...]:
    """Of a user's function; of ours the digest of the package tells."""
    module = sys.modules.get(function.__module__)
    if module is None or function.__module__.partition(".")[0] in OURS:
        return (Path(__file__),) if module else ()
    return files_of(module)


def _origins(names: Mapping[str, Any]) -> Iterator[str]:
    """Where each name comes from, and what is in files that are not ours."""
    for name, value in names.items():
        function = getattr(value, "py_func", value)
        fields = " ".join(getattr(value, "_fields", ()))
        yield f"{name}: {function.__module__}.{function.__qualname__} {fields}".strip()
        for file in _files(function):
            if file != Path(__file__):
                yield f"{file} {hashlib.sha256(file.read_bytes()).hexdigest()}"


@cache
def _digest() -> str:
    """Of the package's own source and of what compiles it."""
    digest = hashlib.sha256()
    for name in ("diagrams", "systems"):
        package = Path(sys.modules[name].__path__[0])
        for file in sorted(package.rglob("*.py")):
            digest.update(file.read_bytes())
    return f"{digest.hexdigest()} numba {numba.__version__} numpy {np.__version__}"


def _remove_unused(folder: Path) -> None:
    oldest = time.time() - _KEPT_S
    for file in folder.glob("loop_*.source"):
        with suppress(OSError):  # another process removes it, too
            if file.stat().st_mtime < oldest:
                for code in (folder / "__pycache__").glob(f"{file.stem}.*"):
                    code.unlink()
                file.unlink()
