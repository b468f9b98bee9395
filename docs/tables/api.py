"""The names that each room exports; ``python -m docs.tables.api`` prints the page."""

from __future__ import annotations

import inspect
import sys
from importlib import import_module
from pkgutil import iter_modules

import analysis
import diagrams
import phonotaxis
import systems

__all__ = ["api_page"]

_TOP = """# Names to import

What stands in `phonotaxis` is public: it changes as
[CONTRIBUTING.md](../CONTRIBUTING.md) says. Below it, each room exports what is meant
for others; modules below a room may move. Blocks are in `systems` itself, too.
`python -m docs.tables.api` prints this page.

## phonotaxis

Loaded name by name, when first used: `import phonotaxis` itself takes no time. All of
it is typed.

| name | what it is |
|---|---|
"""


def rooms() -> list[str]:
    """Packages that export names, those that others rest on first."""
    found = ["systems"]
    for package in (systems, diagrams, analysis):
        if package is diagrams:
            found.append("diagrams")
        found += [
            f"{package.__name__}.{part.name}"
            for part in iter_modules(package.__path__)
            if part.ispkg
        ]
    return [name for name in found if import_module(name).__all__]


def public_names() -> str:
    """A row a public name, with the first line of its docstring."""
    rows = []
    for name in phonotaxis.__all__:
        value = getattr(phonotaxis, name)
        text = "Of the package." if isinstance(value, str) else inspect.getdoc(value)
        rows.append(f"| `{name}` | {(text or '').partition(chr(10))[0]} |\n")
    return "".join(rows)


def api_page() -> str:
    """The page, as Markdown."""
    parts = [_TOP + public_names()]
    for name in rooms():
        room = import_module(name)
        about = (inspect.getdoc(room) or "").partition("\n")[0]
        names = ", ".join(f"`{x}`" for x in room.__all__ if not x.endswith("_"))
        parts.append(f"## {name}\n\n{about}\n\n{names}\n")
    return "\n".join(parts)


if __name__ == "__main__":
    sys.stdout.write(api_page())
