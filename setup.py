"""What ``pyproject.toml`` cannot say: the page of a package index.

That page is README, but its links lead into the repository, of which an index has
nothing. Their words stay, and pictures go.
"""

from __future__ import annotations

import re
from pathlib import Path

#: A link or a picture of Markdown.
_LINK = re.compile(r"(!?)\[([^]]*)\]\(([^)\s]+)\)")
_NOTE = """> Pages that are named here, as `results_hearing.md`, and pictures are in the
> folder `docs` of the sources.
"""


def index_page(readme: str) -> str:
    """README for where the repository is not.

    Args:
        readme: Markdown, whose first paragraph follows its heading.

    Returns:
        The same with links to other sites alone, and a note where the rest is. Code is
        as it was.
    """
    # Every other part is a block of code, with its fences.
    parts = re.split(r"(?ms)(^```.*?^```$)", readme)
    parts[::2] = [_without_relative_links(part) for part in parts[::2]]
    heading, about, rest = "".join(parts).split("\n\n", 2)
    return "\n\n".join([heading, about, _NOTE, rest])


def _without_relative_links(text: str) -> str:
    def plain(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        if re.match(r"https?://", target):
            return match[0]
        return "" if picture else words

    return re.sub(r"\n{3,}", "\n\n", _LINK.sub(plain, text))


if __name__ == "__main__":
    from setuptools import setup

    setup(
        long_description=index_page(Path("README.md").read_text("utf-8")),
        long_description_content_type="text/markdown",
    )
