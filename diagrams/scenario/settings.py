"""Settings: fields that a user gives by their dotted paths, for example ``--set``."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from diagrams.scenario.former_fields import is_constant_now, renamed
from diagrams.scenario.shorthand import begins_anew, require_effect
from diagrams.scenario.worlds.catalog import with_world
from diagrams.scenario.yaml_text import parse_yaml
from systems.framework.input_error import InputError


def plain_settings(
    overrides: Iterable[str] | Mapping[str, Any],
) -> Iterable[tuple[str, Any]]:
    """Returns settings as pairs of a dotted path and a plain value.

    Args:
        overrides: Texts ``path=value``, or a mapping of paths to values, as for
            ``load_scenario``.

    Returns:
        The pairs, in order.

    Raises:
        InputError: A text does not have the form path=value, or a value is not plain.
    """
    if isinstance(overrides, Mapping):
        return [(_dotted(key), _plain(key, value)) for key, value in overrides.items()]
    if isinstance(overrides, str):
        raise InputError(
            "overrides", f"is the text {overrides!r}; give a list of key=value"
        )
    return map(parse_setting, overrides)


def all_settings(
    overrides: Iterable[str] | Mapping[str, Any], fields: Mapping[str, Any]
) -> dict[str, Any]:
    """Returns settings and keyword arguments together; the latter override.

    Args:
        overrides: Settings in one of the forms of ``plain_settings``.
        fields: Values by dotted path.

    Returns:
        Plain values by dotted path.

    Raises:
        InputError: See ``plain_settings``.
    """
    return dict(plain_settings(overrides)) | dict(plain_settings(fields))


def _plain(key: str, value: Any) -> Any:
    """Returns a copy of the value as plain data, in the form of a file."""
    try:
        return json.loads(json.dumps(value, default=_named))
    except (TypeError, ValueError):
        raise InputError(
            key,
            f"{value!r} is not a plain value; give a number, a text, a truth "
            "value, a list or mapping of them, or for a law or block of your own its "
            "function or class",
        ) from None


def _named(value: Any) -> str:
    if not callable(value):
        raise TypeError
    from diagrams.scenario.own_objects import name_of

    return name_of(value)


def parse_setting(text: str) -> tuple[str, Any]:
    """Splits a text ``path=value`` into the dotted path and the value, which is YAML.

    If the text does not have this form, the function raises an ``InputError``.
    """
    key, equals, value_text = text.partition("=")
    if not equals or not all(key.split(".")):
        key, _, value = re.sub(r"\s*:\s*", "=", text, count=1).partition("=")
        remedy = f"write {key or 'seed'}={value or 'VALUE'}"
        raise InputError(text or "--set", f"is not of the form key=value; {remedy}")
    return _dotted(key), parse_yaml(value_text, key)


def _dotted(key: str) -> str:
    """Replaces indices in brackets: ``obstacles[0]`` is ``obstacles.0``."""
    return re.sub(r"\[(\d+)\]", r".\1", key)


def apply_settings(
    data: dict[str, Any], settings: Mapping[str, Any], folder: Path | None = None
) -> None:
    """Sets fields of a scenario to the values that a user has given for them.

    A world replaces the obstacles, the start and the goal. Other settings override the
    world.

    Args:
        data: Fields of a scenario, changed in place.
        settings: Plain values, by dotted path of the field. Names from the previous
            version are possible.
        folder: Folder to which the path of a world refers. None: the working directory.

    Raises:
        InputError: A path is invalid, see ``set_fields``.
        InputError: A field has no effect, because all robots or all sources have values
            of their own.
    """
    fields = {
        renamed(key): value
        for key, value in settings.items()
        if not is_constant_now(key, value)
    }
    if (world := fields.pop("world", None)) is not None:
        new = with_world(data, world, folder or Path.cwd())
        data.clear()
        data.update(new)
    set_fields(data, fields.items())
    require_effect(data, fields)


def set_fields(data: dict[str, Any], fields: Iterable[tuple[str, Any]]) -> None:
    """Sets fields in a tree of plain values.

    Some groups have a field ``preset``, which selects defaults for the group. The
    function sets presets first, so that all other fields override them. If a group
    already has a preset, a new preset first clears this group. The function creates
    missing groups.

    Args:
        data: Fields of a scenario, changed in place.
        fields: Dotted paths and plain values. A path names an entry of a list by its
            index (``obstacles.0.size_m``) or by its name (``obstacles.cart.size_m``).
            If a path occurs twice, the later value wins.

    Raises:
        InputError: A path leads into a plain value, or past the end of a list.
        InputError: A name in a path belongs to no entry of a list, or to several
            entries.
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
