"""How Sphinx makes the site: ``make docs``.

The pages are those of the repository and of docs/ as they are. Made beside them are
only those of the reference, one per public package.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from phonotaxis import __version__  # noqa: E402  # needs the path

project = "phonotaxis"
author = "phonotaxis developers"
copyright = f"2026, {author}"  # noqa: A001  # Sphinx calls it so
version = release = __version__

root_doc = "docs/index"
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**"]
exclude_patterns = [".*", "build", "results", "docs/results"]
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "docs.building.navigation",
    "docs.building.markdown_links",
    "docs.building.mathematics",
    "docs.building.port_tables",
    "docs.building.reference",
]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = ["math"]

# Several classes have a ``range``; Python's own, in signatures, is none of them.
suppress_warnings = ["ref.python"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_default_options = {"exclude-members": "model_config"}

html_theme = "furo"
html_title = f"phonotaxis {version}"
html_static_path = ["_static"]
html_extra_path = ["building/root"]
html_css_files = ["site.css"]
html_js_files = ["scrollers.js"]
html_show_search_summary = False  # it would be fetched, which files cannot be
html_show_sphinx = False
html_copy_source = False
