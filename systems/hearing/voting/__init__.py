"""Directions of single times and frequencies, gathered into sources and tracks."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.hearing.voting.direction_votes import (
        DirectionVotes,
        VoteMemory,
        VotePlan,
        cast_votes,
        join_votes,
    )
    from systems.hearing.voting.listening_plan import vote_plan
    from systems.hearing.voting.steady_sound import is_steady, steered_only
    from systems.hearing.voting.vote_peaks import VotedSource, gather_sources
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "DirectionVotes",
    "VoteMemory",
    "VotePlan",
    "VotedSource",
    "cast_votes",
    "gather_sources",
    "is_steady",
    "join_votes",
    "steered_only",
    "vote_plan",
]
