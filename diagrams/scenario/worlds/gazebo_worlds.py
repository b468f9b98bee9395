"""Worlds of Gazebo, with the reference paths of the BARN challenge.

A file ``world_N.world`` is in SDF, Gazebo's format. Models at rest with collisions that
are cylinders or boxes become obstacles. The file ``path_N.npy`` beside it, or in the
folder ``path_files``, contains the reference path in cells of a grid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario.worlds.world import (
    GOAL_M,
    RADIUS_M,
    START_M,
    World,
    cylinder,
)
from systems.framework.input_error import InputError

_NAME = re.compile(r"world_(\w+)\.(world|sdf)")
#: Side of a cell of the reference path, and center of cell (0, 0) in W, m.
_CELL_M, _CELL_0_M = 2.0 * RADIUS_M, (-RADIUS_M - 30 * 2.0 * RADIUS_M, 5.0 + RADIUS_M)
#: Models that worlds include and that are no obstacles.
_SCENERY = ("model://sun", "model://ground_plane")
#: Largest roll and pitch of an upright model, rad.
_UPRIGHT = 1e-6

Pose = tuple[float, float, float]


def gazebo_worlds(folder: Path) -> dict[str, Callable[[], World]]:
    """Returns a function that reads each world of a folder, by name of the world.

    The name is the part N of the name of the file, ``world_N.world``.

    Args:
        folder: Folder of the files.

    Returns:
        The functions, sorted by the number of the world. They raise an ``InputError``
        if a file is not valid or contains something else than cylinders and boxes.
    """
    found: dict[str, Path] = {}
    for path in folder.iterdir():
        if name := _NAME.fullmatch(path.name):
            found[name[1]] = path
    ordered = sorted(found, key=lambda name: (len(name), name))
    return {name: partial(_world, name, found[name]) for name in ordered}


def _world(name: str, path: Path) -> World:
    route = path_file(path)
    stamps = tuple(each.stat().st_mtime_ns for each in (path, route) if each)
    return _read(name, path, route, stamps)


def path_file(world: Path) -> Path | None:
    """Returns the file with the reference path of a world; None if there is none."""
    found = _NAME.fullmatch(world.name)
    name = f"path_{found[1] if found else ''}.npy"
    places = (world.with_name(name), world.parent / "path_files" / name)
    return next((each for each in places if each.is_file()), None)


@lru_cache(maxsize=512)
def _read(name: str, path: Path, route: Path | None, stamps: tuple[int, ...]) -> World:
    obstacles = []
    for number, (shape, pose) in enumerate(_bodies(path), start=1):
        if len(shape) == 1:
            obstacles.append(cylinder(number, pose[0], pose[1], shape[0]))
            continue
        obstacles.append(
            {
                "name": f"box {number}",
                "size_m": [*shape],
                "waypoints_m": [[pose[0], pose[1]]],
                "heading_deg": math.degrees(math.remainder(pose[2], 2.0 * math.pi)),
            }
        )
    if not obstacles:
        raise InputError(
            str(path), "has no model with a cylinder or a box; check the file"
        )
    length = None if route is None else _path_length(route)
    return World(name, tuple(obstacles), path_length_m=length)


def _path_length(path: Path) -> float:
    """Returns the length of a reference path with its legs to start and goal, m."""
    try:
        cells: NDArray[np.float64] = np.asarray(np.load(path), dtype=float)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(str(path), f"cannot be read ({error})") from None
    if cells.ndim != 2 or cells.shape[1] != 2 or not np.all(np.isfinite(cells)):
        raise InputError(
            str(path), f"has the shape {cells.shape}; a path has the shape (n, 2)"
        )
    points = np.vstack([START_M, np.add(_CELL_0_M, _CELL_M * cells), GOAL_M])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def _bodies(path: Path) -> Iterator[tuple[tuple[float, ...], Pose]]:
    """Yields radius, or length and width, in m, and the pose in W of each body."""
    try:
        root = ET.parse(path).getroot()
    except (OSError, ET.ParseError) as error:
        raise InputError(str(path), f"cannot be read as SDF ({error})") from None
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise InputError(str(path), "has no <world> in <sdf>; give a file of Gazebo")
    for other in world.findall("include"):
        uri = other.findtext("uri", "").strip()
        if uri not in _SCENERY:
            raise InputError(
                str(path), f"includes {uri!r}, which is not read; write its shapes"
            )
    for model in world.findall("model"):
        who = f"model {model.get('name')!r}"
        if model.find("plugin") is not None:
            raise InputError(
                str(path),
                f"{who} has a plugin that moves it; only bodies at rest are read",
            )
        for link in model.findall("link"):
            for body in link.findall("collision"):
                shape = _shape(path, who, body)
                if shape is not None:
                    parts = (model, link, body)
                    yield shape, _pose(path, who, parts)


def _shape(path: Path, who: str, body: ET.Element) -> tuple[float, ...] | None:
    """Returns the radius, or length and width, m; None for a plane."""
    geometry = body.find("geometry")
    kinds = [] if geometry is None else [each.tag for each in geometry]
    if geometry is None or kinds == ["plane"]:
        return None
    size: list[float] = []
    if kinds == ["cylinder"]:
        size = _numbers(path, who, geometry.findtext("cylinder/radius", ""), 1)
    elif kinds == ["box"]:
        size = _numbers(path, who, geometry.findtext("box/size", ""), 3)[:2]
    else:
        raise InputError(
            str(path),
            f"{who} is a {' '.join(kinds) or 'shape without a name'}; only cylinders "
            "and boxes are read",
        )
    if min(size) <= 0.0:
        raise InputError(str(path), f"{who} has the size {size}; it must be positive")
    return tuple(size)


def _pose(path: Path, who: str, parts: tuple[ET.Element, ...]) -> Pose:
    """Returns x, y, and yaw in W, m and rad, from the poses of nested elements."""
    x, y, yaw = 0.0, 0.0, 0.0
    for each in parts:
        place = each.find("pose")
        if place is None:
            continue
        if place.get("frame") or place.get("relative_to"):
            raise InputError(
                str(path), f"{who} has a pose in another frame; give it in the world"
            )
        px, py, _, roll, pitch, turn = _numbers(path, who, place.text or "", 6)
        if max(abs(roll), abs(pitch)) > _UPRIGHT:
            raise InputError(
                str(path),
                f"{who} leans by {max(abs(roll), abs(pitch)):g} rad; only "
                "upright bodies are read",
            )
        c, s = math.cos(yaw), math.sin(yaw)
        x, y, yaw = x + c * px - s * py, y + s * px + c * py, yaw + turn
    return x, y, yaw


def _numbers(path: Path, who: str, text: str, count: int) -> list[float]:
    try:
        values = [float(each) for each in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(
            str(path), f"{who} has {text.strip()!r}; {count} numbers are needed"
        )
    return values
