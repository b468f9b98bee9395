"""What searches look like: plumes, phases, readings, in pictures and in replays."""

from analysis.plumes.plume_history import concentration_map, plume_history
from analysis.plumes.search_panels import search_panels
from analysis.plumes.search_replay import record_searches, record_switch

__all__ = [
    "concentration_map",
    "plume_history",
    "record_searches",
    "record_switch",
    "search_panels",
]
