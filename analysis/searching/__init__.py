"""What became of searches by smell and by ear, over runs and over sounds."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.searching.search_outcomes import (
        SearchOutcomes,
        search_outcomes,
        search_runs,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["SearchOutcomes", "search_outcomes", "search_runs"]
