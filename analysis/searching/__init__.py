"""What became of searches by smell and by ear, over runs and over sounds."""

from analysis.searching.search_outcomes import (
    SearchOutcomes,
    search_outcomes,
    search_runs,
)

__all__ = ["SearchOutcomes", "search_outcomes", "search_runs"]
