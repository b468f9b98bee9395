"""Searches step by step: the robot that smells, and the robots that hear it."""

from systems.search.plume_search import PlumeSearch, PlumeSearchParameters
from systems.search.sound_search import SoundSearch, SoundSearchParameters

__all__ = [
    "PlumeSearch",
    "PlumeSearchParameters",
    "SoundSearch",
    "SoundSearchParameters",
]
