"""Packages that load on demand export what they say, whatever was loaded before."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[3]


def same_names() -> list[tuple[str, str]]:
    """Packages, and what they export that has the name of one of their files."""
    return [
        (".".join(path.parent.relative_to(ROOT).parts), alias.name)
        for folder in ("systems", "diagrams", "analysis")
        for path in (ROOT / folder).rglob("__init__.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if path.with_name(f"{alias.name}.py").is_file()
    ]


@pytest.mark.parametrize(("package", "name"), same_names())
def test_an_export_keeps_its_name_from_a_file(package: str, name: str) -> None:
    # This would put the module into the package.
    import_module(f"{package}.{name}")
    assert not isinstance(getattr(import_module(package), name), ModuleType)
