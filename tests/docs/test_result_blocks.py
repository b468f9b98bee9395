"""The numbers of README and docs are those of ``docs/results``."""

from __future__ import annotations

import pytest

from docs.building import result_blocks

PAGE = """
<!-- results: certificates.full diagram -->

| what | was |
|---|---|

<!-- end -->

It is <!-- value: library_runs.following | least clearance | value -->none<!-- end -->.
"""


def test_pages_are_up_to_date() -> None:
    """``make results`` writes them."""
    pages = {page.name: page.read_text("utf-8") for page in result_blocks.pages()}
    assert sum(len(result_blocks.blocks(text)) for text in pages.values()) > 50
    assert [n for n, text in pages.items() if result_blocks.filled(text) != text] == []


def test_every_result_is_in_a_page() -> None:
    assert result_blocks.unused() == []


def test_tables_and_cells_come_from_the_files() -> None:
    text = result_blocks.filled(PAGE)
    assert "| what | was |" not in text
    assert "| `active` | 200 | 13 | 0.065 (0.038-0.108) | 0 | 13 | 0 |" in text
    assert "value -->0.71 m<!-- end -->" in text
    assert result_blocks.filled(text) == text


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("results: nothing.here", r"nothing.json has no table 'here'"),
        ("results: certificates.here", r"certificates.json has no table 'here'"),
        (
            "value: library_runs.following | top speed | value",
            r"has 0 rows 'top speed' in its table 'following'",
        ),
        (
            "value: library_runs.following | least clearance | mean",
            r"with the columns figure, value",
        ),
    ],
)
def test_what_is_not_there_is_named(block: str, message: str) -> None:
    with pytest.raises(result_blocks.MissingResultError, match=message):
        result_blocks.filled(f"<!-- {block} -->\n\nx\n\n<!-- end -->\n")
