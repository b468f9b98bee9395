"""The order in which the packages may import one another, and what they may not.

Imports are read from the source: what a function imports counts as well.
"""

from __future__ import annotations

import ast
import graphlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OURS = {"systems", "diagrams", "analysis", "phonotaxis", "tests", "benchmarks"}
FOLDERS = ("systems", "diagrams", "analysis")
#: And the door to them.
PACKAGES = (*FOLDERS, "phonotaxis")
#: A room with more is two.
MOST_FILES = 20
MAY_IMPORT = {
    "systems": {"systems"},
    "diagrams": {"systems", "diagrams"},
    "analysis": {"systems", "diagrams", "analysis"},
    "phonotaxis": {"systems", "diagrams", "analysis", "phonotaxis"},
}


def sources(package: str) -> list[Path]:
    """The Python files of a package."""
    return sorted((ROOT / package).rglob("*.py"))


def imported(tree: ast.AST) -> Iterator[str]:
    """Every name that is imported, at any depth: `from a import b` is `a.b`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            origin = "." * node.level + (node.module or "")
            yield from (f"{origin}.{alias.name}" for alias in node.names)


def imported_on_load(tree: ast.AST) -> Iterator[str]:
    """The names whose import runs with the module's own.

    That leaves out the bodies of functions and of `if TYPE_CHECKING`.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from imported(ast.Module([node], []))
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            yield from imported_on_load(ast.Module(node.orelse, []))
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from imported_on_load(node)


def top(name: str) -> str:
    """`a` of `a.b.c`."""
    return name.partition(".")[0]


SAMPLE = ast.parse(
    """
import a.b
from c import d, e as f
from .g import h
if TYPE_CHECKING:
    import i
else:
    import j
try:
    import k
except ImportError:
    pass
class Block:
    import m
    def method(self):
        from n import o
"""
)


def test_reader_sees_every_import() -> None:
    assert set(imported(SAMPLE)) == {
        "a.b", "c.d", "c.e", ".g.h", "i", "j", "k", "m", "n.o"
    }  # fmt: skip


def test_reader_knows_what_runs_on_load() -> None:
    assert set(imported_on_load(SAMPLE)) == {
        "a.b", "c.d", "c.e", ".g.h", "j", "k", "m"
    }  # fmt: skip


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_point_downwards(package: str) -> None:
    forbidden = OURS - MAY_IMPORT[package]
    files = sources(package)
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files
        for name in imported(ast.parse(path.read_text("utf-8")))
        if top(name) in forbidden
    ]
    assert files
    assert not wrong


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_are_absolute_and_narrow(package: str) -> None:
    """Drake advises against `pydrake.all` in libraries."""
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources(package)
        for name in imported(ast.parse(path.read_text("utf-8")))
        if name.startswith((".", "pydrake.all"))
    ]
    assert not wrong


def test_command_line_imports_nothing_but_python_on_load() -> None:
    """`--help` and a mistyped option answer at once."""
    commands = sources("analysis/commands")
    assert commands
    doors = (
        ROOT / "phonotaxis/__init__.py",
        ROOT / "phonotaxis/__main__.py",
        ROOT / "analysis/__init__.py",
    )
    wrong = {
        f"{path.relative_to(ROOT)} imports {name}"
        for path in (*doors, *commands)
        for name in imported_on_load(ast.parse(path.read_text("utf-8")))
        if top(name) not in sys.stdlib_module_names
        and not name.startswith(("analysis.commands", "phonotaxis.main"))
    }
    assert not wrong


def test_help_of_every_command_loads_nothing_else() -> None:
    code = """
import contextlib, io, sys
import phonotaxis
from analysis.commands.command_line import COMMANDS
for words in ([], *([name] for name in COMMANDS)):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        phonotaxis.main([*words, "--help"])
print(*COMMANDS, *(name.partition(".")[0] for name in sys.modules))
"""
    loaded = set(python(code))
    assert {"simulate", "laws", "analysis"} <= loaded
    assert not {"systems", "diagrams", "numpy", "pydrake", "pydantic"} & loaded


def python(code: str) -> list[str]:
    """Words that a new process prints."""
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()


def test_no_other_room_imports_the_commands() -> None:
    wrong = [
        path.relative_to(ROOT)
        for package in FOLDERS
        for path in sources(package)
        if "commands" not in path.relative_to(ROOT).parts
        for name in imported(ast.parse(path.read_text("utf-8")))
        if name.startswith("analysis.commands")
    ]
    assert not wrong


@pytest.mark.parametrize("package", ["systems", "diagrams"])
def test_simulation_loads_no_plotting(package: str) -> None:
    """Nor python-control, pydrake.all, and what scipy imports for a second."""
    code = f"import sys, {package}; print(*sys.modules)"
    loaded = python(code)
    assert package in loaded
    slow = {"matplotlib", "control", "pydrake.all", "scipy.signal", "scipy.stats"}
    assert not slow & set(loaded)


def test_every_folder_with_code_is_a_package() -> None:
    """A folder without `__init__.py` would be left out of the installation."""
    bare = [
        path.parent.relative_to(ROOT)
        for package in PACKAGES
        for path in sources(package)
        if not (path.parent / "__init__.py").is_file()
    ]
    assert not bare


def rooms() -> list[Path]:
    """Every folder of product code."""
    return sorted({path.parent for package in PACKAGES for path in sources(package)})


def test_rooms_are_small_and_say_what_they_are_for() -> None:
    for room in rooms():
        files = [path for path in room.glob("*.py") if path.name != "__init__.py"]
        assert len(files) <= MOST_FILES, room
        told = ast.get_docstring(ast.parse((room / "__init__.py").read_text("utf-8")))
        assert told, room


def neighbours(folder: Path) -> dict[str, set[str]]:
    """What the files and rooms right below a folder import of one another."""
    prefix = ".".join(folder.relative_to(ROOT).parts) + "."
    found: dict[str, set[str]] = {}
    for path in folder.rglob("*.py"):
        below = path.relative_to(folder).with_suffix("").parts
        if below == ("__init__",):
            continue
        names = imported(ast.parse(path.read_text("utf-8")))
        parts = {n.removeprefix(prefix) for n in names if n.startswith(prefix)}
        others = {top(name) for name in parts} - {below[0]}
        found.setdefault(below[0], set()).update(others)
    return {name: others & found.keys() for name, others in found.items()}


@pytest.mark.parametrize("folder", rooms(), ids=lambda p: str(p.relative_to(ROOT)))
def test_no_rooms_and_no_files_import_one_another_in_a_circle(folder: Path) -> None:
    graph = graphlib.TopologicalSorter(neighbours(folder))
    graph.prepare()


def test_a_circle_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    for name, text in (
        ("a/x.py", "from house.b import y"),
        ("b/y.py", "def f():\n    import house.c.z"),
        ("c/z.py", "from house.a.x import g"),
    ):
        path = tmp_path / "house" / name
        path.parent.mkdir(parents=True)
        path.write_text(text, "utf-8")
    assert neighbours(tmp_path / "house") == {"a": {"b"}, "b": {"c"}, "c": {"a"}}
    with pytest.raises(graphlib.CycleError):
        test_no_rooms_and_no_files_import_one_another_in_a_circle(tmp_path / "house")


def test_every_package_is_typed() -> None:
    assert all((ROOT / package / "py.typed").is_file() for package in PACKAGES)


def test_a_name_means_one_thing() -> None:
    """No two public classes or functions of one name.

    Those of ``phonotaxis`` are ours with more to them, and keep their names.
    """
    homes: dict[str, list[str]] = {}
    for package in FOLDERS:
        for path in sources(package):
            for node in ast.parse(path.read_text("utf-8")).body:
                if isinstance(node, ast.ClassDef | ast.FunctionDef):
                    homes.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    twice = {
        name: places
        for name, places in homes.items()
        if len(places) > 1 and not name.startswith("_")
    }
    assert not twice


def test_browser_tests_are_where_make_looks_for_them() -> None:
    marked = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "tests").rglob("test_*.py")
        if "mark.browser" in path.read_text("utf-8") and path != Path(__file__)
    }
    found = {
        path.relative_to(ROOT).as_posix()
        for path in ROOT.glob("tests/test_browser_*.py")
    }
    assert marked == found
