"""Packages that load what they export when it is first asked for.

To list what there is, and to refuse bad input, nothing has to be loaded that simulates.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

__all__ = ["lazy_exports"]


def lazy_exports(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package (PEP 562).

    Its ``__init__.py`` imports what it exports under ``if TYPE_CHECKING``, where
    checkers of types see it: what is read there is imported on demand.

    Args:
        package: Its name.

    Returns:
        Both functions.
    """
    module = sys.modules[package]
    homes: dict[str, str] = {}
    for node in ast.walk(ast.parse(Path(str(module.__file__)).read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            homes |= {alias.name: node.module for alias in node.names}

    class Package(ModuleType):
        """Where a file has the name of what it exports, that keeps the name."""

        def __setattr__(self, name: str, value: Any) -> None:
            if not (name in homes and isinstance(value, ModuleType)):
                super().__setattr__(name, value)

    module.__class__ = Package

    def __getattr__(name: str) -> Any:  # noqa: N807  # it becomes the package's
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    def __dir__() -> list[str]:  # noqa: N807  # it becomes the package's
        return sorted({*vars(module), *homes})

    return __getattr__, __dir__
