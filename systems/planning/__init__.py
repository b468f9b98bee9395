"""Ways through what a robot knows of the floor."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.planning.carrot import find_carrot
    from systems.planning.way import Way, find_way, make_way
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["Way", "find_carrot", "find_way", "make_way"]
