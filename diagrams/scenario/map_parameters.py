"""Parameters of a map of walls, which is one obstacle at rest."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import ClassVar

from pydantic import Field, model_validator

from diagrams.scenario.ros_map import RosMap, read_header, read_ros_map
from diagrams.scenario.yaml_text import dump_yaml
from systems.framework.input_error import InputError
from systems.framework.parameters import Line, Parameters
from systems.world.paths import WaypointPath
from systems.world.shapes import Shape


class MapParameters(Parameters):
    """A map of walls, in the format of the ROS package ``map_server``.

    The occupied cells are one obstacle at rest with the name ``map``. Free and unknown
    cells are free floor.
    """

    name: ClassVar[str] = "map"

    file: Line = Field(min_length=1)
    """Path of ``map.yaml``, relative to the scenario file. It names the image, a PGM
    or PNG with at most 25 million pixels."""
    known: bool = True
    """Whether the map for planned routes contains the occupied cells."""

    @model_validator(mode="after")
    def _check(self) -> MapParameters:
        try:
            read_ros_map(self.file)
        except InputError as error:
            raise InputError(error.field.removeprefix("map."), error.message) from None
        return self

    @property
    def cells(self) -> RosMap:
        """The cells of the map."""
        return read_ros_map(self.file)

    def shape(self) -> Shape:
        """Returns the occupied cells as rectangles, in the axes of the map."""
        return self.cells.shape

    def path(self) -> WaypointPath:
        """Returns the pose of the axes of the map, which are at rest."""
        x, y, theta = self.cells.origin
        return WaypointPath(((x, y),), speed=0.0, heading=theta)


def copy_map(file: str, directory: Path) -> str:
    """Copies a map file and its image to the folder ``map`` of a directory.

    Args:
        file: Path of ``map.yaml``.
        directory: Existing directory.

    Returns:
        Path of the copy, relative to the directory.
    """
    header, folder = read_header(file), directory / "map"
    folder.mkdir(exist_ok=True)
    image = f"map{header.image.suffix}"
    shutil.copyfile(header.image, folder / image)
    fields = header._asdict() | {"image": image, "origin": [*header.origin]}
    fields["negate"] = int(header.negate)
    (folder / "map.yaml").write_text(dump_yaml(fields), "utf-8")
    return "map/map.yaml"
