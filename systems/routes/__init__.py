"""Routes through a known map: found before a run, and anew where a robot stalls."""

from systems.routes.grid_search import find_cells
from systems.routes.route import Route, plan_route

__all__ = ["Route", "find_cells", "plan_route"]
