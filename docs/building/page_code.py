"""What a page has its reader write and run: files, commands and Python, in order.

A block of code is a file where a comment says so in the line before its fence::

    <!-- file: office.yaml -->

All others are run, those in ``sh`` by the shell and those in ``python`` in one
namespace; ``<!-- not run -->`` leaves one out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).resolve().parents[1]
_BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>[^\n]*?) -->\n)?```(?P<language>\w+)\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


class Block(NamedTuple):
    """A block of code."""

    language: str
    text: str
    file: str
    """Name of the file that it is; empty: it is run."""


def page_parts(page: str) -> list[str | Block]:
    """Returns the texts of a page, and its files, commands and Python, in order.

    Args:
        page: File name in docs.
    """
    text, start = (DOCS / page).read_text("utf-8"), 0
    found: list[str | Block] = []
    for match in _BLOCK.finditer(text):
        mark = match["mark"] or ""
        if mark == "not run":
            continue
        file = mark.removeprefix("file: ") if mark.startswith("file: ") else ""
        if file or match["language"] in ("sh", "python"):
            found.append(text[start : match.start()])
            found.append(Block(match["language"], match["text"], file))
            start = match.end()
    return [*found, text[start:]]


def page_blocks(page: str) -> list[Block]:
    """Files, commands and Python of a page of docs, in order.

    Args:
        page: File name in docs.
    """
    return [part for part in page_parts(page) if isinstance(part, Block)]


def page_file(page: str, name: str) -> str:
    """Text of a file that the page shows, as it is at the page's end.

    Raises:
        LookupError: The page shows no such file.
    """
    texts = [block.text for block in page_blocks(page) if block.file == name]
    if not texts:
        raise LookupError(f"docs/{page} shows no file {name}")
    return texts[-1]
