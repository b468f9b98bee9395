"""Pages of the reference, one for each room that docs/api.md names.

In the site each name of that page leads to its docstring, that of a constant to the
comment ``#:`` above it.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Collection, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from sphinx.errors import ExtensionError
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer

__all__ = ["page_of", "setup"]

_DOCS = Path(__file__).resolve().parents[1]
_PAGES = _DOCS / "reference"
_LIST = "docs/api"
#: All blocks have a room of their own, too.
_EVERY_BLOCK = "systems"


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.connect("builder-inited", _write_pages)
    app.connect("builder-inited", _name_blocks)
    app.connect("source-read", _lead_names_to_docstrings)
    app.connect("autodoc-process-docstring", _read_google_style)
    app.connect("autodoc-process-signature", _ask_for_what_is_constructed)
    app.connect("autodoc-skip-member", _leave_out_drake)
    return {"parallel_read_safe": True}


def page_of(folder: Path) -> Path | None:
    """The page of a folder of code, if it has one."""
    name = ".".join(folder.relative_to(_DOCS.parent).parts)
    return _PAGES / f"{name}.rst" if name in _rooms() else None


@cache
def _rooms() -> dict[str, list[str]]:
    """Names by room, as the page lists them."""
    text = (_DOCS / "api.md").read_text("utf-8")
    parts = re.split(r"(?m)^## ([\w.]+)$", text)[1:]
    return {
        room: re.findall(r"`(\w+)`", told)
        for room, told in zip(parts[::2], parts[1::2], strict=True)
    }


def _homes() -> dict[str, str]:
    """The room whose page has a name: the first that exports it, but for systems."""
    rooms = sorted(_rooms().items(), key=lambda room: room[0] != _EVERY_BLOCK)
    found = {name: room for room, names in reversed(rooms[1:]) for name in names}
    return dict.fromkeys(rooms[0][1], _EVERY_BLOCK) | found


def _write_pages(_app: Any) -> None:
    _PAGES.mkdir(exist_ok=True)
    homes = _homes()
    for room, names in _rooms().items():
        own = [name for name in names if homes[name] == room]
        constants = [name for name in own if _is_constant(room, name)]
        told = [name for name in own if name not in constants]
        lines = [room, "=" * len(room), "", f".. automodule:: {room}"]
        lines += [f"   :members: {', '.join(told)}", ""] if told else [""]
        for name in constants:
            lines += _constant(room, name)
        others = [f":py:obj:`{n} <{homes[n]}.{n}>`" for n in names if n not in own]
        if others:
            lines += [f"Exported here as well: {', '.join(others)}.", ""]
        page, text = _PAGES / f"{room}.rst", "\n".join(lines)
        if not page.exists() or page.read_text("utf-8") != text:
            page.write_text(text, "utf-8")


def _is_constant(room: str, name: str) -> bool:
    """Whether a name is of a value, which has no docstring of its own."""
    value = getattr(import_module(room), name)
    return not (inspect.isclass(value) or inspect.isroutine(value))


def _constant(room: str, name: str) -> list[str]:
    """What is known of a constant: its value, or what it holds, and its comment.

    Autodoc looks for that comment in the room alone, which imports the constant.
    """
    value = getattr(import_module(room), name)
    lines = [f".. py:data:: {name}", f"   :module: {room}"]
    if isinstance(value, int | float | str):
        lines.append(f"   :value: {value!r}")
    lines += ["", *(f"   {line}" for line in _comment(room, name)), ""]
    if isinstance(value, Mapping):
        keys = ", ".join(f"``{key}``" for key in value)
        lines += [f"   Holds: {keys}.", ""]
    elif isinstance(value, Collection) and not isinstance(value, str):
        if all(isinstance(each, str) for each in value):
            lines += [f"   Holds: {', '.join(f'``{each}``' for each in value)}.", ""]
        else:
            kinds = dict.fromkeys(type(each).__name__ for each in value)
            lines += [f"   Holds {len(value)} of {' and '.join(kinds)}.", ""]
    return lines


def _comment(room: str, name: str) -> list[str]:
    """The comment ``#:`` above a constant, where the room has it from.

    Raises:
        ExtensionError: There is none.
    """
    code = Path(str(import_module(room).__file__)).read_text("utf-8")
    homes = {
        alias.name: node.module
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    home = homes.get(name, room)
    comments = ModuleAnalyzer.for_module(home).find_attr_docs()
    if not comments.get(("", name)):
        raise ExtensionError(f"{home}.{name} has no comment '#:' that says what it is")
    return comments["", name]


def _name_blocks(_app: Any) -> None:
    """Blocks for several scalars are called as they are exported, not as templates."""
    for room, names in _rooms().items():
        module = import_module(room)
        for name in names:
            if hasattr(module, f"{name}_"):
                getattr(module, name).__name__ = name


def _lead_names_to_docstrings(_app: Any, page: str, source: list[str]) -> None:
    if page != _LIST:
        return
    homes = _homes()

    def reference(match: re.Match[str]) -> str:
        name = match[1]
        return (
            f"{{py:obj}}`{name} <{homes[name]}.{name}>`" if name in homes else match[0]
        )

    pages = "\n".join(f"reference/{room}" for room in _rooms())
    source[0] = re.sub(r"`(\w+)`", reference, source[0])
    source[0] += f"\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n"


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
