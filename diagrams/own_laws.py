"""A user's own law: found, tried, and watched while it runs."""

from __future__ import annotations

import importlib
import importlib.util
import math
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd

from systems.framework.input_error import InputError, shortened
from systems.laws.repulsion import RepulsionParameters

__all__ = ["checked_law", "import_law", "law_files", "try_law"]

_OURS = ("analysis", "diagrams", "systems")


def import_law(name: str) -> Any:
    """The function or class that a law's name stands for.

    Args:
        name: ``package.module:Name`` or ``path/to/file.py:Name``; both are looked
            up in the working directory, too.

    Raises:
        InputError: There is none, or its module cannot be imported.
    """
    module_name, _, attribute = name.rpartition(":")
    if not module_name or not attribute:
        raise InputError(
            "law", f"{name!r} is not known; write package.module:Name or file.py:Name"
        )
    try:
        module = _import(module_name)
        law = getattr(module, attribute, None)
    except (Exception, SystemExit) as error:  # noqa: BLE001  # a user's module
        raise InputError("law", f"{name!r} cannot be imported: {_why(error)}") from None
    if not callable(law):
        raise InputError(
            "law", f"{module_name} has no function or class {attribute!r}; check it"
        )
    return law


def _import(name: str) -> ModuleType:
    if not name.endswith(".py"):
        here = str(Path.cwd())
        if here not in sys.path:
            sys.path.append(here)
        return importlib.import_module(name)
    path = Path(name).expanduser().resolve()
    known = f"law_of_{path}"
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


def law_files(name: str) -> tuple[Path, ...]:
    """Source files of a law's module, and of the user's modules that it uses.

    Args:
        name: Any law; those of the package have none.
    """
    if ":" not in name:
        return ()
    import_law(name)
    module_name = name.rpartition(":")[0]
    found: dict[str, Path] = {}
    waiting = [_import(module_name)]
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


def _is_users(module: ModuleType, file: str) -> bool:
    """Whether versions of packages do not tell what the module holds."""
    if module.__name__.partition(".")[0] in _OURS:
        return False
    # The standard library, and what pip has installed.
    return (
        "site-packages" not in file and Path(sys.base_prefix) not in Path(file).parents
    )


def checked_law(name: str, law: Callable[..., Any]) -> Callable[..., Any]:
    """The law, with an error that names it where it does not return a force."""

    def checked(c: Any, s: Any, repulsion: RepulsionParameters) -> Any:
        try:
            force = law(c, s, repulsion)
        except (Exception, SystemExit) as error:
            raise _failed(name, c, s, f"raises {_why(error)}") from error
        if isinstance(force, np.ndarray) and force.shape == ():
            force = force.item()
        if isinstance(force, AutoDiffXd):
            value = force.value()
        elif isinstance(force, float | int | np.floating | np.integer):
            value = force = float(force)
        else:
            kind = type(force).__name__
            raise _failed(name, c, s, f"returns {_brief(force)} ({kind})")
        if not math.isfinite(value):
            raise _failed(name, c, s, f"returns {value}")
        return force

    return checked


def try_law(
    law: Callable[..., Any],
    repulsion: RepulsionParameters,
    range_m: float,
    top_speed_m_s: float,
) -> None:
    """Calls a law near and far, at rest and fast, as a run will.

    Raises:
        InputError: It does not return a force everywhere.
    """
    for share in (1e-3, 0.1, 0.5, 1.0):
        for s in (0.0, 0.5 * top_speed_m_s, top_speed_m_s):
            law(share * range_m, s, repulsion)


def _failed(name: str, c: Any, s: Any, what: str) -> InputError:
    name = shortened(name, 60)
    at = f"c = {_number(c):.3g} m, s = {_number(s):.3g} m/s"
    return InputError(
        "law",
        f"{name!r} {what} at {at}; write law(c, s, repulsion) that returns a finite "
        "force in N",
    )


def _number(value: Any) -> float:
    return float(value.value() if isinstance(value, AutoDiffXd) else value)


def _brief(value: Any) -> str:
    """As a reader sees it, whatever its own words would be."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001  # a user's __repr__
        return "something"
    return text if len(text) < 40 else f"{text[:37]}..."


def _why(error: BaseException) -> str:
    """Kind and text of an error in a user's code, with its line."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if Path(f.filename).resolve() != Path(__file__).resolve()]
    own = [f for f in own if "importlib" not in f.filename]
    at = f" in line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return f"{text}{at}"
