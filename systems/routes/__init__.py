"""Routes through a known map: found before a run, and anew where a robot stalls."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.routes.grid_search import find_cells
    from systems.routes.route import Route, plan_route
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["Route", "find_cells", "plan_route"]
