"""Ways through what a robot knows of the floor."""

from systems.planning.carrot import find_carrot
from systems.planning.way import Way, find_way, make_way

__all__ = ["Way", "find_carrot", "find_way", "make_way"]
