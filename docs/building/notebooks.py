"""Notebooks of pages: the same text and code, to run cell by cell.

``python -m docs.building.notebooks`` writes them. They have no outputs.
"""

from __future__ import annotations

import json
from typing import Any

from docs.building.page_code import DOCS, Block, page_parts

#: Pages that have a notebook of the same name.
PAGES = ("your_diagram.md",)


def notebook(page: str) -> str:
    """Returns the notebook of a page, in the format 4.5 of Jupyter.

    Args:
        page: File name in docs.
    """
    parts = [
        part for part in page_parts(page) if not isinstance(part, str) or part.strip()
    ]
    document = {
        "cells": [_cell(f"cell-{k}", part) for k, part in enumerate(parts)],
        "metadata": {
            "kernelspec": {
                "display_name": "Python 3",
                "language": "python",
                "name": "python3",
            },
            "language_info": {"name": "python"},
        },
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _cell(name: str, part: str | Block) -> dict[str, Any]:
    if isinstance(part, str):
        return {
            "cell_type": "markdown",
            "id": name,
            "metadata": {},
            "source": part.strip().splitlines(keepends=True),
        }
    magic = f"%%writefile {part.file}\n" if part.file else ""
    if not part.file and part.language == "sh":
        magic = "%%bash\n"
    return {
        "cell_type": "code",
        "execution_count": None,
        "id": name,
        "metadata": {},
        "outputs": [],
        "source": f"{magic}{part.text}".rstrip("\n").splitlines(keepends=True),
    }


def main() -> None:
    """Writes the notebooks of all pages that have one."""
    for page in PAGES:
        path = (DOCS / page).with_suffix(".ipynb")
        path.write_text(notebook(page), "utf-8")


if __name__ == "__main__":
    main()
