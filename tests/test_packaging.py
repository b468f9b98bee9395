"""What the package needs and holds is declared."""

from __future__ import annotations

import ast
import re
import runpy
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
TEMPLATE = ROOT / "phonotaxis" / "template"
PACKAGES = ("systems", "diagrams", "analysis", "phonotaxis")


def plain(requirement: str) -> str:
    """Name of a distribution, as pip compares it."""
    name = re.split(r"[<>=!~\[; ]", requirement, maxsplit=1)[0]
    return re.sub(r"[-_.]+", "-", name).lower()


def imported() -> set[str]:
    """Top names of all that product code imports, at any depth."""
    found: set[str] = set()
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if TEMPLATE in path.parents:  # a project of its own
                continue
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.Import):
                    found |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    found.add(node.module.partition(".")[0])
    return found - set(sys.stdlib_module_names) - set(PACKAGES)


def test_every_library_that_is_imported_is_declared() -> None:
    project = PROJECT["project"]
    extras = [
        each
        for name in ("export", "live", "movie", "sweep")
        for each in project["optional-dependencies"][name]
    ]
    declared = {plain(each) for each in (*project["dependencies"], *extras)}
    homes = packages_distributions()
    needed = {
        name: {plain(each) for each in homes.get(name, [name])} for name in imported()
    }
    assert {"pydrake", "numba", "mcap_ros2"} <= needed.keys()
    assert not {name for name, homes in needed.items() if not homes & declared}


def test_every_file_that_is_no_code_goes_along() -> None:
    """Scenarios, layouts, styles and scripts of pages, and the mark of types."""
    data = PROJECT["tool"]["setuptools"]["package-data"]
    declared = {
        path
        for package, patterns in data.items()
        for home in (PACKAGES if package == "*" else [package.replace(".", "/")])
        for pattern in patterns
        for path in (ROOT / home).glob(pattern)
        if path.is_file()
    }
    files = {
        path
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
        if path.suffix != ".py" or TEMPLATE in path.parents
    }
    assert len(files) > 40
    assert files == declared


def test_the_template_depends_on_this_version() -> None:
    project = tomllib.loads((TEMPLATE / "pyproject.toml").read_text("utf-8"))["project"]
    version = PROJECT["project"]["version"]
    minor = version.rpartition(".")[0]
    assert project["dependencies"] == [f"phonotaxis>={minor}"]
    workflow = (TEMPLATE / ".github/workflows/tests.yml").read_text("utf-8")
    page = (ROOT / "docs" / "use_in_your_project.md").read_text("utf-8")
    for text in (workflow, page):
        assert re.findall(r"phonotaxis@v([\d.]+)", text)
        assert {*re.findall(r"phonotaxis@v([\d.]+)", text)} == {version}


def index_page(readme: str) -> str:
    """What ``setup.py`` makes of it."""
    page: str = runpy.run_path(str(ROOT / "setup.py"))["index_page"](readme)
    return page


def test_the_page_of_an_index_has_no_link_into_the_repository() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    page = index_page(readme)
    code = r"(?ms)^```.*?^```$"
    assert not re.findall(r"\]\((?!https?://)[^)]*\)", re.sub(code, "", page))
    assert re.findall(code, page) == re.findall(code, readme)


def test_links_to_other_sites_and_code_stay() -> None:
    page = index_page(
        "# a\n\nSee [b](docs/b.md#c), ![d](e.png)[f](https://f.example).\n\n"
        "```python\nheard[0](x)\n```\n\nLast [g\nh](g.md).\n"
    )
    assert "See b, [f](https://f.example)." in page
    assert "```python\nheard[0](x)\n```" in page
    assert page.endswith("Last g\nh.\n")
