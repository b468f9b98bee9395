"""Links out of the pages, to folders of the repository.

A folder is no page: those of code lead to their page in the reference, of others the
words remain. Files need nothing: the site carries them along.
"""

from __future__ import annotations

import os
import re
from functools import partial
from pathlib import Path
from typing import Any

from docs.building.reference import page_of


def setup(app: Any) -> dict[str, bool]:
    """Joins Sphinx."""
    app.connect("source-read", _lead_folders_elsewhere)
    return {"parallel_read_safe": True}


def _lead_folders_elsewhere(app: Any, page: str, source: list[str]) -> None:
    at = Path(app.srcdir, page).parent
    source[0] = re.sub(r"\[([^]]+)\]\(([^)#\s:]+)\)", partial(_link, at), source[0])


def _link(at: Path, match: re.Match[str]) -> str:
    words, target = match.groups()
    if not (at / target).is_dir():
        return match[0]
    page = page_of((at / target).resolve())
    return words if page is None else f"[{words}]({os.path.relpath(page, at)})"
