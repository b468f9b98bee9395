"""Notebooks are those of their pages."""

from __future__ import annotations

import json

import pytest

from docs.building.notebooks import PAGES, notebook
from docs.building.page_code import DOCS, page_blocks


@pytest.mark.parametrize("page", PAGES)
def test_a_notebook_is_that_of_its_page(page: str) -> None:
    """``make results`` writes it."""
    text = (DOCS / page).with_suffix(".ipynb").read_text("utf-8")
    assert text == notebook(page)
    cells = json.loads(text)["cells"]
    code = ["".join(c["source"]) for c in cells if c["cell_type"] == "code"]
    blocks = page_blocks(page)
    assert len(code) == len(blocks)
    for source, block in zip(code, blocks, strict=True):
        assert source.endswith(block.text.rstrip("\n"))
    assert code[0].startswith("%%writefile cart_pole.sdf\n<sdf")
    (title, *_) = ["".join(c["source"]) for c in cells if c["cell_type"] == "markdown"]
    assert title.startswith("# Linearize your own diagram\n")
