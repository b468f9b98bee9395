"""Loads scenarios from the library, from YAML files and from the command line."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagrams.scenario.fields.shipped import SCHEMA_FILE, known_laws
from diagrams.scenario.suggestions import did_you_mean
from diagrams.scenario.yaml_text import LARGEST_BYTES, dump_yaml, parse_yaml
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario

_LIBRARY = Path(__file__).parents[1] / "scenarios"
#: File with the effective scenario in a result directory.
SCENARIO_FILE = "scenario.yaml"


def library_scenarios() -> dict[str, Path]:
    """Returns the file of each scenario in the package, by name of the scenario."""
    return {path.stem: path for path in sorted(_LIBRARY.glob("*.yaml"))}


def load_scenario(
    source: str | Path | Mapping[str, Any] = "default",
    overrides: Iterable[str] | Mapping[str, Any] = (),
    **fields: Any,
) -> Scenario:
    """Loads a scenario from the library or from a file, and changes some of its fields.

    Args:
        source: A name from the library (``phonotaxis scenarios``), the path of a file,
            a result
            directory, whose scenario is loaded again, or the contents of such a file.
        overrides: Fields to change. One form is a mapping of dotted paths to values:
            ``{"source.speed_m_s": 0.2}``. The other form is a list of texts
            ``path=value``, where the value is YAML: ``["source.speed_m_s=0.2"]``. A
            path names an obstacle by its name or its index: ``obstacles.cart.size_m``
            or ``obstacles.0.size_m``.
        **fields: Further fields to change, for example ``law="active"``. They override
            ``overrides``.

    Returns:
        The validated scenario.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
        InputError: A field is unknown, has the wrong type, or is out of range. The
            error states the full path of each such field.
    """
    # Lists of commands and of scenarios need no models of the fields.
    from diagrams.scenario.scenario import scenario_from_mapping
    from diagrams.scenario.settings import all_settings, apply_settings, plain_settings

    settings = all_settings(overrides, fields)
    if isinstance(source, Mapping):
        data = {"name": "scenario", **dict(plain_settings(source))}
    else:
        data = written_fields(source, law=settings.get("law"))
    apply_settings(data, settings)
    resolve_files(data, Path.cwd())
    return scenario_from_mapping(data)


def changed_scenario(
    scenario: Scenario | str | Path,
    settings: Iterable[str] | Mapping[str, Any] = (),
    fields: Mapping[str, Any] | None = None,
) -> Scenario:
    """Returns a scenario with some fields changed.

    Args:
        scenario: The scenario, or a source for ``load_scenario``.
        settings: Fields to change, as for ``load_scenario``.
        fields: Further fields to change. They override ``settings``.

    Returns:
        The changed scenario.

    Raises:
        InputError: See ``load_scenario``.
    """
    from diagrams.scenario.scenario import Scenario

    if not isinstance(scenario, Scenario):
        return load_scenario(scenario, settings, **(fields or {}))
    if not settings and not fields:
        return scenario
    return scenario.with_(settings, **(fields or {}))


def scenario_text(source: str | Path) -> str:
    """Returns the YAML file of a scenario as it was written, with its comments.

    Args:
        source: A name from the library, the path of a file, or a result directory.

    Returns:
        The text of the file.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
    """
    path = _find(source)
    read_mapping(path)
    return path.read_text("utf-8")


def written_fields(source: str | Path, *, law: Any = None) -> dict[str, Any]:
    """Reads the fields that the file of a scenario sets.

    Names of fields from the previous version are replaced by the present names. Paths
    of sound files and of the map become absolute. If the file states no name of the
    scenario, the function adds one.

    Args:
        source: A name from the library, or the path of a file.
        law: Law that will replace the law of the file, on which the present names of
            some fields depend. None: the law of the file.

    Returns:
        Plain values of the fields.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
    """
    from diagrams.scenario.former_fields import renewed
    from diagrams.scenario.worlds.catalog import absolute

    path = _find(source)
    data = renewed(read_mapping(path), law)
    data.setdefault("name", path.stem)
    resolve_files(data, path.parent)
    if data.get("world"):
        data["world"] = absolute(data["world"], path.parent)
    return data


def dump_scenario(scenario: Scenario) -> str:
    """Returns the whole scenario as YAML, which ``load_scenario`` can load."""
    return dump_yaml(scenario.model_dump(mode="json"))


def write_scenario(
    scenario: Scenario, directory: Path, *, relative: bool = False
) -> None:
    """Writes a whole scenario and a copy of its JSON Schema to an existing directory.

    The files are ``scenario.yaml`` and ``scenario.schema.json``. Comments at the
    beginning list the fields that differ from their defaults. Text editors use the
    schema to check and complete fields. With the copy, they find the schema even after
    the directory was moved. The folder ``own_code`` has the user's own laws and blocks.
    The folder ``map`` has a copy of the map.

    Args:
        scenario: The scenario.
        directory: Existing directory.
        relative: Whether paths of sound files start in the directory. Otherwise, they
            are absolute. The path of a map is always that of the copy.
    """
    from diagrams.scenario.differences import differences_text
    from diagrams.scenario.map_parameters import copy_map
    from diagrams.scenario.own_sources import write_own_sources

    robots = scenario.robots.values()
    write_own_sources((name for own in robots for name in own.own_code), directory)
    data = scenario.model_dump(mode="json")
    if relative:
        _change_files(data, lambda file: os.path.relpath(file, directory))
    if scenario.map is not None:
        data["map"]["file"] = copy_map(scenario.map.file, directory)
    first = f"# yaml-language-server: $schema={SCHEMA_FILE.name}\n"
    text = first + differences_text(scenario) + dump_yaml(data)
    (directory / SCENARIO_FILE).write_text(text, "utf-8")
    shutil.copyfile(SCHEMA_FILE, directory / SCHEMA_FILE.name)


def _find(source: str | Path) -> Path:
    library = library_scenarios()
    if str(source) in library:
        return library[str(source)]
    path = Path(source)
    known = "a name that 'phonotaxis scenarios' lists"
    if str(source) and path.is_dir():
        if (path / SCENARIO_FILE).is_file():
            _require_one_run(path)
            return path / SCENARIO_FILE
        for below in sorted(path.glob(f"*/{SCENARIO_FILE}")):
            raise InputError(
                "scenario",
                f"{source} has the runs of several laws; choose one, for example "
                f"phonotaxis simulate {below.parent}",
            )
        raise InputError(
            "scenario",
            f"the directory {source} has no {SCENARIO_FILE}; use a result directory, "
            f"{known}, or the path of a .yaml file",
        )
    if path.suffix in (".yaml", ".yml"):
        if path.is_file():
            return path
        raise InputError(
            "scenario",
            f"there is no file {source}; check the path, or use {known}"
            f"{did_you_mean(path.stem, library)}",
        )
    hint = did_you_mean(str(source), library)
    if str(source) and Path(f"{source}.yaml").is_file():
        hint = f" (did you mean '{source}.yaml'?)"
    elif "=" in str(source):
        hint = f"; to set a field, write --set {source}"
    elif str(source) in known_laws():
        hint = "; laws are listed with commas and without spaces, as in --law a,b"
    raise InputError(
        "scenario",
        f"{str(source)!r} is not known; use {known}, or the path of a .yaml file{hint}",
    )


def _require_one_run(path: Path) -> None:
    """Rejects result directories whose scenario is not that of a run."""
    if (path / "sweep.yaml").is_file():
        raise InputError(
            "scenario",
            f"{path} has the runs of a sweep; its report.html lists commands that "
            f"repeat runs, and {path / SCENARIO_FILE} is the scenario without changes",
        )
    if (path / "recommended.yaml").is_file():
        raise InputError(
            "scenario",
            f"{path} is a result of design; choose phonotaxis simulate "
            f"{path / 'recommended.yaml'} or {path / SCENARIO_FILE}",
        )


def read_mapping(path: Path) -> dict[str, Any]:
    """Reads the mapping of fields in a YAML file; an empty file has no fields.

    If the file cannot be read or does not contain a mapping, the function raises an
    ``InputError``.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    data = parse_yaml(content, str(path))
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise InputError(
            str(path), "must hold a mapping of fields, for example 'duration_s: 40'"
        )
    return data


def resolve_files(data: dict[str, Any], folder: Path) -> None:
    """Makes relative paths of sound files and of the map absolute.

    Args:
        data: Fields of a scenario, changed in place.
        folder: Folder to which the relative paths refer: the folder of the scenario
            file, or the working directory.
    """
    _change_files(data, lambda file: str((folder / file).resolve()))


def _change_files(data: dict[str, Any], change: Callable[[str], str]) -> None:
    """Changes the paths of all sound files and of the map in a scenario."""
    for place in [
        data,
        *_participants(data, "robots").values(),
        *_participants(data, "sources").values(),
    ]:
        for group, key in (
            ("microphones", "ego_noise_file"),
            ("sound", "file"),
            ("loudspeaker", "file"),
            ("map", "file"),
        ):
            fields = place.get(group)
            if isinstance(fields, dict) and isinstance(fields.get(key), str):
                fields[key] = change(fields[key])


def _participants(data: dict[str, Any], group: str) -> dict[str, dict[str, Any]]:
    named = data.get(group)
    found = named.items() if isinstance(named, dict) else ()
    return {name: fields for name, fields in found if isinstance(fields, dict)}
