"""``phonotaxis init``: starts a project of the user."""

from __future__ import annotations

import re
import shutil
from argparse import ArgumentParser, Namespace
from pathlib import Path

from phonotaxis.commands.arguments import take_json
from phonotaxis.commands.command import Command, Printed, Take
from phonotaxis.name_clashes import PACKAGES
from phonotaxis.result import Prepared

_PACKAGE = "my_robot"
_TEMPLATE = Path(__file__).parents[1] / "template"
_NEW_SCENARIO = "phonotaxis scenarios default --copy"


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument(
        "directory", nargs="?", metavar="DIR", help="new directory of the project"
    )
    take_json(parser)


def _prepare(options: Namespace, take: Take) -> Prepared[Printed]:
    from analysis.report.provenance import SCHEMA_VERSION
    from systems.framework.input_error import InputError

    name = options.directory
    if name is None:
        raise InputError(
            "directory",
            "is missing; write phonotaxis init my_robot for a project, or "
            f"{_NEW_SCENARIO} my_scenario.yaml for a scenario",
        )
    if name.endswith((".yaml", ".yml")):
        raise InputError(
            "directory", f"{name} is a scenario's name; write {_NEW_SCENARIO} {name}"
        )
    package = re.sub(r"\W", "_", Path(name).name.casefold())
    if not package.isidentifier() or package in (*PACKAGES, "phonotaxis", "tests"):
        raise InputError(
            "directory",
            f"{name} would give a package named {package!r}, which is not possible; "
            "write for example phonotaxis init my_robot",
        )
    try:
        shutil.copytree(_TEMPLATE, name, ignore=shutil.ignore_patterns("__pycache__"))
        _rename(Path(name), package)
    except OSError as error:
        raise InputError(
            "directory",
            f"{name} cannot be written ({error.strerror}); name a new directory",
        ) from None
    files = sorted(str(path) for path in Path(name).rglob("*") if path.is_file())
    return Prepared(
        run=lambda _: Printed(
            {"schema_version": SCHEMA_VERSION, "directory": name, "files": files},
            f"wrote {name}; its README.md has the next steps",
        )
    )


def _rename(project: Path, package: str) -> None:
    """Gives the project of the template, and its package, the name of the directory."""
    for path in [each for each in project.rglob("*") if each.is_file()]:
        text = path.read_text("utf-8").replace(_PACKAGE, package)
        project_name = package.replace("_", "-")
        path.write_text(text.replace(_PACKAGE.replace("_", "-"), project_name), "utf-8")
    (project / _PACKAGE).rename(project / package)


COMMAND = Command(
    "init",
    "write a new project with a law, a block, tests and a CI file",
    _add_arguments,
    _prepare,
    examples=("init my_robot",),
)
