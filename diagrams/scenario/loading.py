"""Loads scenarios from the library, from YAML files and from the command line."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagrams.scenario.fields.shipped import SCHEMA_FILE
from diagrams.scenario.suggestions import did_you_mean
from diagrams.scenario.yaml_text import LARGEST_BYTES, dump_yaml, parse_yaml
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario

_LIBRARY = Path(__file__).parents[1] / "scenarios"


def library_scenarios() -> dict[str, Path]:
    """Returns the file of each scenario in the package, by name of the scenario."""
    return {path.stem: path for path in sorted(_LIBRARY.glob("*.yaml"))}


def load_scenario(
    source: str | Path = "default",
    overrides: Iterable[str] | Mapping[str, Any] = (),
) -> Scenario:
    """Loads a scenario from the library or from a file, and changes some of its fields.

    Args:
        source: A name from the library (``phonotaxis scenarios``), or the path of a
            file.
        overrides: Fields to change. One form is a mapping of dotted paths to values:
            ``{"source.speed_m_s": 0.2}``. The other form is a list of texts
            ``path=value``, where the value is YAML: ``["source.speed_m_s=0.2"]``. A
            path names an obstacle by its name or its index: ``obstacles.cart.size_m``
            or ``obstacles.0.size_m``.

    Returns:
        The validated scenario.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
        InputError: A field is unknown, has the wrong type, or is out of range. The
            error states the full path of each such field.
    """
    # Lists of commands and of scenarios need no models of the fields.
    from diagrams.scenario.scenario import scenario_from_mapping
    from diagrams.scenario.settings import apply_settings, plain_settings

    data = written_fields(source)
    apply_settings(data, dict(plain_settings(overrides)))
    resolve_sound(data, Path.cwd())
    return scenario_from_mapping(data)


def written_fields(source: str | Path) -> dict[str, Any]:
    """Reads the fields that the file of a scenario sets.

    Names of fields from the previous version are replaced by the present names. Paths
    of sound files become absolute. If the file states no name of the scenario, the
    function adds one.

    Args:
        source: A name from the library, or the path of a file.

    Returns:
        Plain values of the fields.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
    """
    from diagrams.scenario.former_fields import renewed

    path = _find(source)
    data = renewed(read_mapping(path))
    data.setdefault("name", path.stem)
    resolve_sound(data, path.parent)
    return data


def dump_scenario(scenario: Scenario) -> str:
    """Returns the whole scenario as YAML, which ``load_scenario`` can load."""
    return dump_yaml(scenario.model_dump(mode="json"))


def write_scenario(scenario: Scenario, directory: Path) -> None:
    """Writes a whole scenario and a copy of its JSON Schema to an existing directory.

    The files are ``scenario.yaml`` and ``scenario.schema.json``. Text editors use the
    schema to check and complete fields. With the copy, they find the schema even after
    the directory was moved.
    """
    first = f"# yaml-language-server: $schema={SCHEMA_FILE.name}\n"
    (directory / "scenario.yaml").write_text(first + dump_scenario(scenario), "utf-8")
    shutil.copyfile(SCHEMA_FILE, directory / SCHEMA_FILE.name)


def _find(source: str | Path) -> Path:
    library = library_scenarios()
    if str(source) in library:
        return library[str(source)]
    path = Path(source)
    known = "a name that 'phonotaxis scenarios' lists"
    if path.suffix in (".yaml", ".yml"):
        if path.is_file():
            return path
        raise InputError(
            "scenario", f"there is no file {source}; check the path, or use {known}"
        )
    raise InputError(
        "scenario",
        f"{str(source)!r} is not known; use {known}, or the path of a .yaml file"
        f"{did_you_mean(str(source), library)}",
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


def resolve_sound(data: dict[str, Any], folder: Path) -> None:
    """Makes relative paths of sound files absolute.

    Args:
        data: Fields of a scenario, changed in place.
        folder: Folder to which the relative paths refer: the folder of the scenario
            file, or the working directory.
    """
    for place in [
        data,
        *_participants(data, "robots").values(),
        *_participants(data, "sources").values(),
    ]:
        for group, key in (
            ("microphones", "ego_noise_file"),
            ("sound", "file"),
            ("loudspeaker", "file"),
        ):
            fields = place.get(group)
            if isinstance(fields, dict) and isinstance(fields.get(key), str):
                fields[key] = str((folder / fields[key]).resolve())


def _participants(data: dict[str, Any], group: str) -> dict[str, dict[str, Any]]:
    named = data.get(group)
    found = named.items() if isinstance(named, dict) else ()
    return {name: fields for name, fields in found if isinstance(fields, dict)}
