"""The site's navigation: the sections of docs/index.md, with the pages they name."""

from __future__ import annotations

import re
from typing import Any


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.connect("source-read", _add_trees)
    return {"parallel_read_safe": True}


def _add_trees(app: Any, page: str, source: list[str]) -> None:
    if page != app.config.root_doc:
        return
    sections = re.split(r"(?m)^## (.+)$", source[0])[1:]
    for caption, text in zip(sections[::2], sections[1::2], strict=True):
        pages = re.findall(r"\]\(([\w./]+)\.md\)", text)
        source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n"
        source[0] += "\n".join(pages) + "\n```\n"
