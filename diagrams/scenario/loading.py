"""Loads scenarios from the library, from YAML files and from the command line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic_core import ValidationError

from diagrams.scenario.fields.explain import explain
from diagrams.scenario.fields.near_miss import did_you_mean
from diagrams.scenario.fields.shipped import SCHEMA_FILE, scenario_schema
from diagrams.scenario.former_fields import renamed, renewed
from diagrams.scenario.shorthand import as_written, begins_anew, require_effect
from diagrams.scenario.yaml_text import LARGEST_BYTES, dump_yaml, parse_yaml
from systems.framework.input_error import InputError

if TYPE_CHECKING:
    from diagrams.scenario.scenario import Scenario

_LIBRARY = Path(__file__).parents[1] / "scenarios"


def library_scenarios() -> dict[str, Path]:
    """Names and files of the scenarios in the package."""
    return {path.stem: path for path in sorted(_LIBRARY.glob("*.yaml"))}


def load_scenario(
    source: str | Path = "default",
    overrides: Iterable[str] | Mapping[str, Any] = (),
) -> Scenario:
    """Loads a scenario.

    Args:
        source: A name from the library (``phonotaxis scenarios``), or the path of a
            file.
        overrides: Texts ``key=value`` with a dotted key and a value in YAML, for
            example ``source.speed_m_s=0.2``. An obstacle is given by its name or by its
            index: ``obstacles.cart.size_m=[0.2, 0.1]`` or
            ``obstacles.0.size_m=[0.2, 0.1]``. A mapping of dotted keys to values also
            works, for example ``{"source.speed_m_s": 0.2}``.

    Returns:
        The validated scenario.

    Raises:
        InputError: The name is unknown, the file is unreadable, or fields are unknown,
            of the wrong type or out of range. The error names each field by its full
            path.
    """
    data = written_fields(source)
    apply_settings(data, dict(_settings(overrides)))
    resolve_sound(data, Path.cwd())
    return scenario_from_mapping(data)


def written_fields(source: str | Path) -> dict[str, Any]:
    """Reads the fields that the file of a scenario sets.

    Args:
        source: See ``load_scenario``.

    Returns:
        Plain values by present names, with a name, and with absolute paths of sounds.

    Raises:
        InputError: The name is unknown, or the file is unreadable.
    """
    path = _find(source)
    data = renewed(read_mapping(path))
    data.setdefault("name", path.stem)
    resolve_sound(data, path.parent)
    return data


def apply_settings(data: dict[str, Any], settings: Mapping[str, Any]) -> None:
    """Sets fields of a scenario that a user has given by their paths.

    Args:
        data: Fields of a scenario, changed in place.
        settings: Plain values by dotted path. Former names are accepted.

    Raises:
        InputError: See ``set_fields``, or a field has no effect because all robots or
            all sources have values of their own.
    """
    fields = {renamed(key): value for key, value in settings.items()}
    set_fields(data, fields.items())
    require_effect(data, fields)


def changed(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Returns a copy of a scenario with changes, see ``Scenario.with_``."""
    data = scenario.model_dump(mode="json")
    apply_settings(data, dict(_settings(changes)))
    return scenario_from_mapping(data)


def _settings(
    overrides: Iterable[str] | Mapping[str, Any],
) -> Iterable[tuple[str, Any]]:
    if isinstance(overrides, Mapping):
        return [(key, _plain(key, value)) for key, value in overrides.items()]
    if isinstance(overrides, str):
        raise InputError(
            "overrides", f"is the text {overrides!r}; give a list of key=value"
        )
    return map(parse_setting, overrides)


def _plain(key: str, value: Any) -> Any:
    """Returns a copy of the value as plain data, in the form of a file."""
    try:
        return json.loads(json.dumps(value))
    except (TypeError, ValueError):
        raise InputError(
            key,
            f"{value!r} is not a plain value; give a number, a text, a truth "
            "value, or a list or mapping of them",
        ) from None


def scenario_from_mapping(data: Mapping[str, Any]) -> Scenario:
    """Validates a mapping of plain values; see ``load_scenario``."""
    from diagrams.scenario.scenario import Scenario

    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        written = partial(as_written, data=data)
        raise explain(error, scenario_schema(), "a scenario", written) from None


def dump_scenario(scenario: Scenario) -> str:
    """Returns the whole scenario as YAML, which ``load_scenario`` can load."""
    return dump_yaml(scenario.model_dump(mode="json"))


def write_scenario(scenario: Scenario, directory: Path) -> None:
    """Writes the whole scenario and a copy of its schema, which helps editors.

    With the copy, editors find the schema even if the directory is moved to another
    place or machine.

    Args:
        scenario: The scenario, for ``scenario.yaml``.
        directory: An existing directory; it also gets ``scenario.schema.json``.
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

    Raises:
        InputError: The file cannot be read, or contains something else.
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
        folder: Folder to which the paths are relative: that of the scenario file, or
            the working directory.
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


def parse_setting(text: str) -> tuple[str, Any]:
    """Splits ``key=value`` into the key and the value, which is YAML.

    Raises:
        InputError: The text does not have this form.
    """
    key, equals, value_text = text.partition("=")
    if not equals or not all(key.split(".")):
        raise InputError(
            text or "--set", "is not of the form key=value, for example seed=2"
        )
    return key, parse_yaml(value_text, key)


def set_fields(data: dict[str, Any], fields: Iterable[tuple[str, Any]]) -> None:
    """Sets fields of a mapping.

    The function sets presets first, so that all other fields override them. If a group
    already has a preset, a new preset clears the group. Missing groups on the path to a
    field are created.

    Args:
        data: Fields of a scenario, changed in place.
        fields: Dotted paths and plain values. An entry of a list is given by its index
            (``obstacles.0.size_m``) or by its name (``obstacles.cart.size_m``). If two
            paths are the same, the later value wins.

    Raises:
        InputError: A path leads into a plain value or past the end of a list, or a
            name in it is the name of no entry or of several entries of a list.
    """
    for key, value in sorted(fields, key=lambda field: not _is_preset(*field)):
        _set_field(data, key, value)


def _is_preset(key: str, value: Any) -> bool:
    return begins_anew({key.rpartition(".")[2]: value})


def _set_field(data: dict[str, Any], key: str, value: Any) -> None:
    *parents, last = key.split(".")
    node: Any = data
    for depth, part in enumerate(parents):
        node = _descend(node, part, ".".join(parents[: depth + 1]))
    if isinstance(node, list):
        node[_index(node, last, key)] = value
    elif isinstance(node, dict):
        if begins_anew(node) and _is_preset(key, value):
            node.clear()
        node[last] = value
    else:
        raise InputError(key, "leads into a plain value; shorten the key")


def _descend(node: Any, part: str, key: str) -> Any:
    if isinstance(node, list):
        return node[_index(node, part, key)]
    if isinstance(node, dict):
        if node.get(part) is None:  # missing, or null, for example room
            node[part] = {}
        return node[part]
    raise InputError(key, "leads into a plain value; shorten the key")


def _index(node: list[Any], part: str, key: str) -> int:
    if part.isdigit() and int(part) < len(node):
        return int(part)
    names = [each.get("name") for each in node if isinstance(each, dict)]
    found = [k for k, each in enumerate(names) if each == part]
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(
            key, f"{len(found)} entries have the name {part!r}; use an index, from 0"
        )
    known = ", ".join(repr(name) for name in names if name)
    raise InputError(
        key,
        f"{part!r} is neither an index of a list of {len(node)} nor the name of an "
        f"entry; count from 0{f', or use {known}' if known else ''}",
    )
