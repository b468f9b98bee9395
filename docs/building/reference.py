"""Pages of the reference: one per public package, with the docstring of each name."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from typing import Any

from sphinx.ext.napoleon.docstring import GoogleDocstring

_DOCS = Path(__file__).resolve().parents[1]
_PAGES = _DOCS / "reference"
_PACKAGES = ("phonotaxis", "phonotaxis.testing", "systems", "diagrams")


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.connect("builder-inited", _write_pages)
    app.connect("builder-inited", _name_blocks)
    app.connect("source-read", _lead_to_pages)
    app.connect("autodoc-process-docstring", _read_google_style)
    app.connect("autodoc-process-signature", _ask_for_what_is_constructed)
    app.connect("autodoc-skip-member", _leave_out_drake)
    return {"parallel_read_safe": True}


def page_of(folder: Path) -> Path | None:
    """The page of a folder of code, if it has one."""
    name = ".".join(folder.relative_to(_DOCS.parent).parts)
    return _PAGES / f"{name}.rst" if name in _PACKAGES else None


def _names(package: str) -> list[str]:
    """What a package offers, without templates and without what phonotaxis offers."""
    module, public = import_module(package), import_module("phonotaxis")
    return [
        name
        for name in module.__all__
        if not name.endswith("_")
        and (
            module is public or getattr(public, name, None) is not getattr(module, name)
        )
    ]


def _write_pages(_app: Any) -> None:
    _PAGES.mkdir(exist_ok=True)
    for package in _PACKAGES:
        members = ", ".join(_names(package))
        lines = [package, "=" * len(package), "", f".. automodule:: {package}"]
        page, text = (
            _PAGES / f"{package}.rst",
            "\n".join([*lines, f"   :members: {members}", ""]),
        )
        if not page.exists() or page.read_text("utf-8") != text:
            page.write_text(text, "utf-8")


def _lead_to_pages(_app: Any, page: str, source: list[str]) -> None:
    """Only the site has the pages: the list of names is read elsewhere as well."""
    if page == "docs/api":
        pages = "\n".join(f"reference/{package}" for package in _PACKAGES)
        source[0] += f"\n```{{toctree}}\n:maxdepth: 1\n\n{pages}\n```\n"


def _name_blocks(_app: Any) -> None:
    """Blocks for several scalars are called as they are exported, not as templates."""
    module = import_module("systems")
    for name in _names("systems"):
        if f"{name}_" in module.__all__:
            getattr(module, name).__name__ = name


def _read_google_style(*told: Any) -> None:
    """Sections of a docstring as fields of reStructuredText, and |v| as it stands.

    Napoleon as an extension takes "N: the push" of an attribute for its type.
    """
    lines: list[str] = told[-1]
    for number, line in enumerate(lines):
        parts = line.split("``")
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[number] = "``".join(parts)
    lines[:] = GoogleDocstring(lines).lines()


def _ask_for_what_is_constructed(*told: Any) -> tuple[str, str] | None:
    """Blocks for several scalars take what ``_construct`` takes."""
    construct = getattr(told[3], "_construct", None)
    if told[1] != "class" or construct is None:
        return None
    _, *others = inspect.signature(construct).parameters.values()
    mine = [each for each in others if each.name != "converter"]
    return str(inspect.Signature(mine)), ""


def _leave_out_drake(_app: Any, what: str, name: str, *_: Any) -> bool | None:
    """Overrides, and what templates add to blocks, are PascalCase."""
    return True if what == "class" and name[0].isupper() else None
