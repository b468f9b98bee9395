"""Expands the shorthand of scenario files to complete robots and sources, and back.

In a file, fields of robots at the top level apply to all robots of the kinds that have
these fields. A value under ``robots`` replaces such a field for one robot. In the same
way, ``source`` and ``sound`` apply to all sources. ``resolved`` expands this shorthand.
``file_form`` restores it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from pydantic import BaseModel

from diagrams.scenario.participants import DEFAULT_LAW, KINDS, Robot, kind_of
from systems.framework.input_error import InputError
from systems.laws.catalog import LAWS

#: Name of the field of a file that replaces the source by a point.
GOAL_FIELD = "goal_m"
#: Names of the only robot and of the only source.
ROBOT, SOURCE = "robot", "source"

#: Kinds of robots that have a field, by name of the field.
ROBOT_FIELDS: dict[str, tuple[str, ...]] = {}
for _kind, _model in KINDS.items():
    for _name in _model.model_fields:
        ROBOT_FIELDS[_name] = (*ROBOT_FIELDS.get(_name, ()), _kind)


def begins_anew(changes: Mapping[str, Any]) -> bool:
    """Returns whether changes to a group of fields select a preset for this group.

    A preset selects defaults for a group, and clears its other fields. The result is
    true if the value of ``preset`` is a text. If the value is a mapping, then
    ``preset`` is only the name of a robot or source.
    """
    return isinstance(changes.get("preset"), str)


def joined(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a copy of a tree of plain values, with changes applied.

    Args:
        base: The tree.
        changes: A tree that contains only the values to change or add. If the changes
            select a preset for a group, they replace the whole group.

    Returns:
        A new tree.
    """
    result = {} if begins_anew(changes) else dict(base)
    for key, value in changes.items():
        before = _plain(result.get(key))
        listed: dict[str, Any] = {}
        if isinstance(before, list | tuple):
            listed = {str(k): each for k, each in enumerate(before)}
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            result[key] = joined(before, value)
        elif isinstance(value, Mapping) and listed and value.keys() <= listed.keys():
            # Changes to some elements of a list, by index.
            result[key] = [*joined(listed, value).values()]
        else:
            result[key] = value
    return result


def _plain(value: Any) -> Any:
    return value.model_dump() if isinstance(value, BaseModel) else value


def resolved(data: Mapping[str, Any]) -> dict[str, Any]:
    """Expands the shorthand of a scenario file to complete robots and sources.

    In a file, a field at the top level applies to all robots or sources. The function
    copies such fields to each robot and source.

    Args:
        data: Fields of a scenario, as in a file.

    Returns:
        Fields of the run, with complete ``robots`` and ``sources``. Values of a wrong
        type stay unchanged, so that the validation reports them.

    Raises:
        InputError: ``source`` has a sound, or ``goal_m`` is given with ``sources``.
    """
    data = _with_goal(data)
    run = {key: value for key, value in data.items() if key not in ROBOT_FIELDS}
    shared = {key: value for key, value in data.items() if key in ROBOT_FIELDS}
    source, sound = _plain(run.pop("source", {})), _plain(run.pop("sound", {}))
    robots = run.get("robots") or {ROBOT: {}}
    if "sound" in _group(data.get("source")):
        raise InputError("source.sound", "is not a field of a scenario; use sound")
    if isinstance(robots, Mapping):
        robots = _robots(robots, shared, sound)
        run["robots"] = robots
    if not isinstance(source, Mapping) or not isinstance(sound, Mapping):
        if isinstance(source, Mapping):
            source = {**source, "sound": sound}
        return run | {"sources": {SOURCE: source}}
    base = joined({"sound": sound}, source)
    sources = run.get("sources") or {}
    if isinstance(robots, Mapping) and not sources:
        follows = any(
            _follows_a_source(each, [other for other in robots if other != name])
            for name, each in robots.items()
        )
        sources = {SOURCE: {}} if follows else {}
    if isinstance(sources, Mapping):
        run["sources"] = {
            name: joined(base, own) if isinstance(own, Mapping) else own
            for name, own in sources.items()
        }
    return run


def _with_goal(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """Replaces the field ``goal_m`` by the fields that it stands for."""
    if data.get(GOAL_FIELD) is None:
        return {key: value for key, value in data.items() if key != GOAL_FIELD}
    if data.get("sources"):
        raise InputError(
            GOAL_FIELD,
            "cannot hold together with sources; remove one of them, or set body: false "
            "for the source that is the goal",
        )
    found = dict(data)
    goal, law = found.pop(GOAL_FIELD), str(data.get("law", DEFAULT_LAW))
    if law in LAWS and LAWS[law].robot == "router":
        return joined(found, {"route": {"goal_m": goal}})
    return joined(
        found,
        {
            "hearing": "ideal_always",
            "attraction": {"follow_distance_m": 0.0},
            "source": {"waypoints_m": [goal], "body": False},
        },
    )


def _group(value: Any) -> dict[str, Any]:
    return dict(value) if isinstance(value, Mapping) else {}


def _robots(
    robots: Mapping[str, Any], shared: Mapping[str, Any], sound: Any
) -> dict[str, Any]:
    """Applies fields at the top level of a file to the robots that have these fields.

    If none of the robots has a field, the function adds it to all robots, so that the
    validation reports an error.
    """
    kinds = {
        name: own.kind if isinstance(own, Robot) else kind_of({**shared, **_group(own)})
        for name, own in robots.items()
    }
    nowhere = {
        field
        for field in shared
        if not set(ROBOT_FIELDS[field]).intersection(kinds.values())
    }
    found = {}
    for name, own in robots.items():
        if not isinstance(own, Mapping):
            found[name] = own
            continue
        base = {
            field: value
            for field, value in shared.items()
            if kinds[name] in ROBOT_FIELDS[field] or field in nowhere
        }
        fields = joined(base, own)
        law = fields.get("law", DEFAULT_LAW)
        gains = fields.get("laws", {})
        known = isinstance(law, str) and law in LAWS and LAWS[law].gains is not None
        if known and isinstance(gains, Mapping) and kinds[name] in ROBOT_FIELDS["laws"]:
            fields["laws"] = joined({law: {}}, gains)
        played = fields.get("loudspeaker")
        if isinstance(played, Mapping) and isinstance(sound, Mapping):
            fields["loudspeaker"] = joined(sound, played)
        found[name] = fields
    return found


def _follows_a_source(robot: Any, others: Sequence[str]) -> bool:
    if KINDS[kind_of(robot)].has_goal:
        return False
    follows = robot.get("follows") if isinstance(robot, Mapping) else robot.follows
    return follows not in others


def as_written(place: Sequence[str], data: Mapping[str, Any]) -> list[str]:
    """Returns the path at which a user wrote a field in the file.

    Args:
        place: Parts of the path of the field in the expanded scenario. As in errors of
            pydantic, the kind of a robot may follow the name of the robot.
        data: Fields of the scenario, as in the file.

    Returns:
        Parts of the path in the file.
    """
    if len(place) < 2 or place[0] not in ("robots", "sources"):
        return list(place)
    group, name, *rest = place
    if group == "robots" and rest[:1] and rest[0] in KINDS:
        rest = rest[1:]
    short = rest
    if group == "sources" and rest[:1] != ["sound"]:
        short = ["source", *rest]
        if rest[:1] == ["waypoints_m"] and data.get(GOAL_FIELD) is not None:
            return [GOAL_FIELD]
    own = _group(data.get(group)).get(name)
    if not data.get(group) or (not _has(own, rest) and _has(data, short)):
        return short
    return [group, name, *rest]


def _has(data: Any, place: Sequence[str]) -> bool:
    for part in place:
        if not isinstance(data, Mapping) or part not in data:
            return False
        data = data[part]
    return True


@contextmanager
def fields_of(group: str, name: str, **renamed: str) -> Iterator[None]:
    """Adds the path of a robot or source to the errors of its blocks (context manager).

    A block knows only the path of a field within its own parameters.

    Args:
        group: ``robots`` or ``sources``.
        name: Name of the robot or source that has the block.
        **renamed: Names of groups in the scenario, by their names in the block.

    Yields:
        Nothing.

    Raises:
        InputError: The error of the block, with the path of its field in the scenario.
    """
    try:
        yield
    except InputError as error:
        first, *rest = error.field.split(".")
        if first not in ROBOT_FIELDS and first != "sound":
            raise
        field = ".".join([renamed.get(first, first), *rest])
        raise InputError(field_in(group, name, field), error.message) from None


def field_in(group: str, name: str, field: str) -> str:
    """Returns the shortest dotted path of a robot's or source's field in a scenario.

    For a robot with the default name, the path of ``start.position_m`` is unchanged.
    For a robot named ``first``, it is ``robots.first.start.position_m``.

    Args:
        group: ``robots`` or ``sources``.
        name: Name of the robot or source.
        field: Path of the field within the robot or source.

    Returns:
        Path of the field in the scenario.
    """
    if name == ROBOT:
        return field
    if name == SOURCE:
        return field if field.startswith("sound") else f"source.{field}"
    return f"{group}.{name}.{field}"


def require_effect(data: Mapping[str, Any], fields: Iterable[str]) -> None:
    """Raises an error if a field that a user has set has no effect.

    A field at the top level has no effect if all robots or all sources set the field
    themselves.

    Args:
        data: Fields of a scenario, as in a file.
        fields: Dotted paths of the fields that the user has set.

    Raises:
        InputError: A field has no effect.
    """
    for field in fields:
        place = field.split(".")
        if place[0] in ROBOT_FIELDS:
            group, below = "robots", place
        elif place[0] in ("source", "sound"):
            group, below = "sources", place[1:] if place[0] == "source" else place
        else:
            continue
        named = _group(data.get(group))
        leaves = [[*below, *leaf] for leaf in _leaves(data, place)]
        if (
            below
            and named
            and all(_has(own, leaf) for own in named.values() for leaf in leaves)
        ):
            names = ", ".join(f"{group}.{name}.{'.'.join(below)}" for name in named)
            raise InputError(
                field, f"has no effect, because {names} are set; set these instead"
            )


def _leaves(tree: Any, place: Sequence[str]) -> Iterator[list[str]]:
    """Yields the paths of the leaves below a place, relative to this place."""
    if place:
        below = tree.get(place[0]) if isinstance(tree, Mapping) else None
        yield from _leaves(below, place[1:])
    elif isinstance(tree, Mapping) and tree:
        for key, value in tree.items():
            yield from ([key, *leaf] for leaf in _leaves(value, []))
    else:
        yield []


def file_form(dump: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a scenario in the shortest form that a file can have.

    In this form, fields that are equal in all robots or sources are at the top level.
    ``dump`` has the plain values of all fields of the scenario. ``resolved`` turns the
    result into ``dump`` again.
    """
    run = dict(dump)
    robots, sources = run.pop("robots"), run.pop("sources")
    shared, robots = _hoisted(robots)
    if [*robots] != [ROBOT]:
        run["robots"] = robots
    run |= shared
    if sources:
        base, sources = _hoisted(sources)
        run["sound"] = base.pop("sound", {})
        run["source"] = base
        if [*sources] != [SOURCE]:
            run["sources"] = sources
    return run


def _hoisted(
    trees: Mapping[str, Mapping[str, Any]],
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Separates the values that all trees share from the rest of each tree."""
    shared = _common(list(trees.values()))
    return shared, {name: _without(tree, shared) for name, tree in trees.items()}


def _common(trees: Sequence[Mapping[str, Any]], depth: int = 0) -> dict[str, Any]:
    """Returns the values that are equal in all trees of fields.

    At the top level, a value may be missing in some of the trees, because robots of
    other kinds lack this field. Groups with different presets have nothing in common.
    """
    found: dict[str, Any] = {}
    for key in dict.fromkeys(key for tree in trees for key in tree):
        values = [tree[key] for tree in trees if key in tree]
        if depth and len(values) < len(trees):
            continue
        if all(value == values[0] for value in values):
            found[key] = values[0]
        elif all(isinstance(value, Mapping) for value in values) and (
            len({value.get("preset") for value in values}) == 1
        ):
            found[key] = _common(values, depth + 1)
    return found


def _without(tree: Mapping[str, Any], shared: Mapping[str, Any]) -> dict[str, Any]:
    left = {}
    for key, value in tree.items():
        if key not in shared:
            left[key] = value
        elif shared[key] != value:
            left[key] = _without(value, shared[key])
    return left
