"""Searches step by step: the robot that smells, and the robots that hear it."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from systems.search.parameters import PlumeSearchParameters, SoundSearchParameters
    from systems.search.plume_search import PlumeSearch
    from systems.search.sound_search import SoundSearch
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "PlumeSearch",
    "PlumeSearchParameters",
    "SoundSearch",
    "SoundSearchParameters",
]
