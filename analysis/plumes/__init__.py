"""What searches look like: plumes, phases, readings, in pictures and in replays."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.plumes.plume_history import concentration_map, plume_history
    from analysis.plumes.search_panels import search_panels
    from analysis.plumes.search_replay import record_searches, record_switch
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "concentration_map",
    "plume_history",
    "record_searches",
    "record_switch",
    "search_panels",
]
