"""Generates the source code of a loop's parts, and compiles it once for all processes.

A part is a function of the tick (control period), for example the step of one block.
numba saves compiled code only for functions in files, and separately for each
combination of argument types. Therefore the generated source goes to a file in the
cache folder. The name of this file is a hash of everything that the code depends on.

The source names functions and named tuples, but reads all numbers from a few arrays by
address. It therefore does not depend on these numbers.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import sys
import time
from collections import namedtuple
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, cached_property
from itertools import count
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from diagrams.running.compiled.parts import ARRAYS
from diagrams.scenario.own_code import digests_of
from systems.framework.compiling import cache_folder, njit, source_digest
from systems.framework.input_error import InputError, shortened
from systems.framework.parameters import Parameters

#: Time without use after which a generated file is removed, s.
_KEPT_S = 30 * 86_400.0

_LOGGER = logging.getLogger("phonotaxis")
_COUNT = count()


class LoopPart:
    """Builds the source code of one part of a compiled loop.

    A part is a generated function with the number of the tick (control period) as its
    argument. The object also stores the values and functions to which the source code
    refers. ``expression`` returns the source code for a value, and ``name`` returns the
    name of a function in the source code.
    """

    def __init__(self) -> None:
        self.names: dict[str, Any] = {}
        """Functions and named tuples, by their names in the source."""
        self._floats: list[float] = []
        self._words = [0, 0]
        self._arrays: dict[int, str] = {}
        self._kept: list[Any] = []

    def source(self, lines: Sequence[str]) -> str:
        """Returns the complete source code of the part, a function of ``tick``.

        ``lines`` is the code in the function. The generated function returns 0 unless
        one of the lines returns another value.
        """
        words = f"{self.name(ARRAYS[np.dtype(np.int64)])}(address, (1,))"
        floats = f"{self.name(ARRAYS[np.dtype(np.float64)])}(words[0], (words[1],))"
        body = [f"words = {words}", f"floats = {floats}", *lines, "return 0"]
        return "\n".join(["def part(tick, address):", *_indented(body), ""])

    def words(self) -> NDArray[np.int64]:
        """The words of the part. The caller keeps this array and passes its address."""
        floats = np.array(self._floats)
        self._kept.append(floats)
        self._words[:2] = floats.ctypes.data, floats.size
        return np.array(self._words, dtype=np.int64)

    def expression(self, value: Any) -> str:
        """Returns source code that evaluates to a value.

        Parameters become a named tuple of their fields and cached properties. A list
        becomes an array, and an empty list becomes an array of shape (0, 2). None
        becomes 0.

        Args:
            value: A number, text, array, function, list, tuple of values, parameters,
                or None.

        Returns:
            The source code of the value.

        Raises:
            InputError: The value has another type, or contains a value of another type.
        """
        if isinstance(value, Parameters):
            kind = _tuple_type(type(value))
            return self._call(kind, [getattr(value, name) for name in kind._fields])
        if isinstance(value, tuple):
            return self._call(type(value), value)
        if isinstance(value, str) or callable(value):
            return repr(value) if isinstance(value, str) else self.name(value)
        if value is None or isinstance(value, float):
            self._floats.append(0.0 if value is None else value)
            return f"floats[{len(self._floats) - 1}]"
        if isinstance(value, int):
            word = self._word(value)
            return f"({word} != 0)" if isinstance(value, bool) else word
        return self._array(value)

    def name(self, function: Any) -> str:
        """Returns the name of a function or class; a function is made compilable."""
        plain = getattr(function, "py_func", function)
        known = _compilable(plain) if isinstance(plain, FunctionType) else plain
        for name, value in self.names.items():
            if value is known:
                return name
        # The name of a lambda has angle brackets.
        name = f"{known.__name__.strip('<>')}_{len(self.names)}"
        self.names[name] = known
        return name

    def _call(self, kind: type, values: Any) -> str:
        text = "".join(f"{self.expression(value)}, " for value in values)
        return f"{self.name(kind)}({text})" if hasattr(kind, "_fields") else f"({text})"

    def _word(self, value: int) -> str:
        self._words.append(int(value))
        return f"words[{len(self._words) - 1}]"

    def _array(self, value: Any) -> str:
        """Returns source code that evaluates to an array.

        The code reads the address and the shape of the array from the words of the
        part. Because the code contains neither the values nor the sizes of the array,
        the same source serves arrays of other values and sizes.
        """
        if id(value) not in self._arrays:
            # An empty list becomes an array of pairs. A scalar becomes an array with
            # one number.
            empty = isinstance(value, list) and not value
            whole = np.ascontiguousarray(np.empty((0, 2)) if empty else value)
            if whole.dtype not in ARRAYS:
                raise InputError(
                    "engine",
                    f"{shortened(repr(value), 60)} cannot be used in compiled "
                    "loops; give blocks numbers or arrays, or run with engine "
                    "drake",
                )
            self._kept += value, whole
            at = self._word(whole.ctypes.data)
            shape = "".join(f"{self._word(size)}, " for size in whole.shape)
            text = f"{self.name(ARRAYS[whole.dtype])}({at}, ({shape}))"
            scalar = isinstance(value, np.generic)
            self._arrays[id(value)] = f"{text}[0]" if scalar else text
        return self._arrays[id(value)]


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


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
    """Makes a function callable from compiled code, without the checks that wrap it.

    The result is a plain function, because numba identifies a plain function by its
    type alone. A compiled function in a named tuple would be a pointer, and numba does
    not cache code with pointers. ``function`` may also call plain functions in a user's
    own modules.
    """
    plain = inspect.unwrap(function)
    if not isinstance(plain, FunctionType):
        raise InputError(
            "engine",
            f"{shortened(repr(plain), 60)} is not a function, and numba compiles only "
            "functions; write it as one, or run with engine drake",
        )
    for called in _users_helpers(plain, set()):
        register_jitable(called)
    return register_jitable(plain)


def _users_helpers(
    function: FunctionType, known: set[FunctionType]
) -> set[FunctionType]:
    """Returns the functions of a user's modules that a user's function calls."""
    if _is_ours(function):
        return set()
    for name in function.__code__.co_names:
        called = function.__globals__.get(name)
        if not isinstance(called, FunctionType) or called in {function, *known}:
            continue
        module = sys.modules.get(called.__module__)
        if called.__module__ == "__main__" or (module and digests_of(module)):
            known.add(called)
            _users_helpers(called, known)
    return known


def compiled_part(source: str, names: Mapping[str, Any]) -> Any:
    """Compiles the function ``part`` of generated source, or loads its compiled code.

    ``source`` comes from ``LoopPart.source``. ``names`` has the objects that the source
    uses, by their names in the source. Equal arguments give the same function.
    """
    return _loaded(source, tuple(names.items()))


@cache
def _loaded(source: str, named: tuple[tuple[str, Any], ...]) -> Any:
    file = _file(source, dict(named))
    if file is None or not any((file.parent / "__pycache__").glob(f"{file.stem}.*")):
        _say_that_it_takes_time()
    # numba needs the module of a cached function. Other parts get unique names.
    name = file.stem if file else f"part_{next(_COUNT)}"
    module = ModuleType(f"phonotaxis.{name}")
    sys.modules[module.__name__] = module
    vars(module).update(named)
    exec(compile(source, str(file or "<part>"), "exec"), vars(module))
    return njit("int64(int64, int64)", cache=file is not None)(module.part)


@cache
def _say_that_it_takes_time() -> None:
    _LOGGER.info("compiling code for this kind of scenario, for up to 80 s ...")


def address_of(part: Any) -> int:
    """Returns the address by which ``run_parts`` calls a part from ``compiled_part``.

    The address is valid as long as the caller keeps the part.
    """
    (found,) = part.overloads.values()
    address: int = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
    return address


def _file(source: str, names: Mapping[str, Any]) -> Path | None:
    """Writes generated source code to a file in the cache folder.

    The name of the file is a hash of all that the code depends on. The result is None
    if the file cannot be written, or if the code calls a function whose source files do
    not determine what it does, such as a closure.
    """
    origins = (
        [*map(str, _origins(names))] if all(map(_is_known, names.values())) else []
    )
    if not origins:
        return None
    text = "".join([*(f"# {line}\n" for line in origins), source])
    folder = cache_folder() / "parts"
    file = folder / f"part_{hashlib.sha256(text.encode()).hexdigest()[:24]}.source"
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
    """Whether the files that define a function determine what it does."""
    function = getattr(value, "py_func", value)
    module = sys.modules.get(function.__module__)
    if module is None:
        return False
    if isinstance(function, FunctionType):
        # A function is stale if its module has been loaded again since.
        stale = function.__globals__ is not vars(module)
        if function.__closure__ or stale:
            return False
    return _is_ours(function) or bool(digests_of(module))


def _is_ours(function: Any) -> bool:
    """Whether the digest of the package determines what a function does."""
    return str(function.__module__).partition(".")[0] in ("diagrams", "systems")


def _origins(names: Mapping[str, Any]) -> Iterator[str]:
    """Yields the origins of the names, and digests of all files that define them."""
    files = {Path(__file__)}
    for name, value in names.items():
        function = getattr(value, "py_func", value)
        module = sys.modules[function.__module__]
        fields = " ".join(getattr(value, "_fields", ()))
        yield f"{name}: {function.__module__}.{function.__qualname__} {fields}".strip()
        if module.__file__:
            files.add(Path(module.__file__).resolve())
        if not _is_ours(function):
            for file, digest in digests_of(module).items():
                files.add(Path(file))
                yield f"{file} {digest}"
    yield f"{source_digest(*files)} numba {numba.__version__}"


def _remove_unused(folder: Path) -> None:
    oldest = time.time() - _KEPT_S
    for file in folder.glob("part_*.source"):
        with suppress(OSError):  # another process may remove it at the same time
            if file.stat().st_mtime < oldest:
                for code in (folder / "__pycache__").glob(f"{file.stem}.*"):
                    code.unlink()
                file.unlink()
