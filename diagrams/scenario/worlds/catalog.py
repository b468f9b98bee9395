"""Finds the worlds of a folder, and puts a world into the fields of a scenario."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from diagrams.scenario.shorthand import joined
from diagrams.scenario.suggestions import did_you_mean
from diagrams.scenario.worlds.cylinder_tables import CYLINDERS, PATHS, read_tables
from diagrams.scenario.worlds.gazebo_worlds import gazebo_worlds, path_file
from diagrams.scenario.worlds.map_tests import MAP, TESTS, map_tests
from diagrams.scenario.worlds.world import World
from systems.framework.input_error import InputError

#: Name of the set of worlds that comes with the package, and its folder.
SHIPPED = "shipped"
_SHIPPED_FOLDER = Path(__file__).parents[2] / "worlds"


def open_worlds(source: str | Path) -> dict[str, Callable[[], World]]:
    """Lists the worlds of a set, without reading all of them.

    Args:
        source: ``shipped``, or a folder with ``cylinders.csv`` and ``paths.csv``, with
            ``world_N.world``, or with folders of maps.

    Returns:
        A function that reads each world, by name of the world, in order.

    Raises:
        InputError: The folder has no worlds, or a file is not valid.
    """
    folder = _SHIPPED_FOLDER if str(source) == SHIPPED else Path(source).expanduser()
    if (folder / CYLINDERS).exists() or (folder / PATHS).exists():
        stamps = tuple(_stamp(folder / name) for name in (CYLINDERS, PATHS))
        worlds = _tables(folder, stamps)
        return {name: partial(worlds.__getitem__, name) for name in worlds}
    if folder.is_dir() and (found := gazebo_worlds(folder) or map_tests(folder)):
        return found
    what = "has no" if folder.is_dir() else "is no folder with"
    raise InputError(
        "worlds",
        f"{source} {what} {CYLINDERS}, world_0.world, or maps with "
        f"{TESTS}; give the folder that has them, or {SHIPPED!r}",
    )


def world_files(text: Any, folder: Path) -> list[Path]:
    """Returns the files that contain a world, which ``find_world`` reads."""
    source, name = _parts(text, folder)
    root = _SHIPPED_FOLDER if source == SHIPPED else Path(source)
    if (root / CYLINDERS).exists():
        return [root / CYLINDERS, root / PATHS]
    files = [root / f"world_{name}.{ending}" for ending in ("world", "sdf")]
    paths = [path_file(file) for file in files]
    maps = [root, root / name.rpartition("_")[0]]
    tests = [place / file for place in maps for file in (MAP, TESTS)]
    return [*files, *(path for path in paths if path), *tests]


def find_world(text: Any, folder: Path) -> World:
    """Returns one world.

    Args:
        text: ``PATH:NAME``, or the name of a world that comes with the package.
        folder: Folder to which a relative path refers.

    Returns:
        The world.

    Raises:
        InputError: There is no such world, or its file is not valid.
    """
    source, name = _parts(text, folder)
    worlds = open_worlds(source)
    if name not in worlds:
        raise InputError(
            "world",
            f"{text!r} is not known; phonotaxis worlds {source} lists the names"
            f"{did_you_mean(name, worlds)}",
        )
    return worlds[name]()


def absolute(text: Any, folder: Path) -> str:
    """Returns the text of a world with the full path of its set."""
    source, name = _parts(text, folder)
    return f"{source}:{name}"


def _parts(text: Any, folder: Path) -> tuple[str, str]:
    source, _, name = str(text).rpartition(":")
    if source in ("", SHIPPED):
        return SHIPPED, name
    return str(folder / Path(source).expanduser()), name


def chosen_worlds(
    source: str | Path, every: int = 1, names: Sequence[str] = ()
) -> list[str]:
    """Selects worlds of a set, as values for the field ``world``.

    Args:
        source: See ``open_worlds``.
        every: Only worlds whose number is divisible by this number. The number of a
            world is its name, or its place in the set, from 0, if a name is no number.
        names: Names of the worlds. Empty: all.

    Returns:
        ``PATH:NAME`` of each world.

    Raises:
        InputError: A name is unknown, or no world is left.
    """
    known = [*open_worlds(source)]
    for name in names:
        if name not in known:
            raise InputError(
                "names", f"{source} has no world {name!r}{did_you_mean(name, known)}"
            )
    if every < 1:
        raise InputError("every", f"{every} must be at least 1")
    numbers = [*range(len(known))]
    if all(name.isdecimal() for name in known):
        numbers = [*map(int, known)]
    chosen = [
        name
        for name, number in zip(known, numbers, strict=True)
        if number % every == 0 and (not names or name in names)
    ]
    if not chosen:
        raise InputError("every", f"{every} selects none of the worlds of {source}")
    return [f"{source}:{name}" for name in chosen]


def with_world(data: Mapping[str, Any], text: Any, folder: Path) -> dict[str, Any]:
    """Returns a scenario whose obstacles, start and goal are replaced by a world's.

    Args:
        data: Fields of the scenario.
        text: See ``find_world``.
        folder: Folder to which a relative path refers.

    Returns:
        The new fields, without ``world``.

    Raises:
        InputError: See ``find_world``.
    """
    own = {key: value for key, value in data.items() if key != "world"}
    return joined(own, _fields(own, text, folder))


def filled(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Returns a scenario file with the fields of the world that it names.

    Other fields of the file override those of the world. The obstacles of the file are
    added to those of the world. Otherwise, see ``with_world``.
    """
    own = {key: value for key, value in data.items() if key != "world"}
    if not data.get("world"):
        return own
    found = _fields(own, data["world"], folder)
    if isinstance(added := own.pop("obstacles", []), list | tuple):
        found["obstacles"] += added
    else:  # the validation of the scenario reports it
        own["obstacles"] = added
    return joined(found, own)


def _fields(data: Mapping[str, Any], text: Any, folder: Path) -> dict[str, Any]:
    return find_world(text, folder).fields(data)


def _stamp(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(maxsize=8)
def _tables(folder: Path, stamps: tuple[tuple[int, int], ...]) -> dict[str, World]:
    return read_tables(folder)
