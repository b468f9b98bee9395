"""Sounds in recordings of arrays that people have."""

from analysis.recordings.array_geometry import ArrayGeometry, load_geometry
from analysis.recordings.channel_faults import find_channel_faults
from analysis.recordings.locate import locate
from analysis.recordings.locate_result import LocateResult, SourceEstimate
from analysis.recordings.locate_text import locate_text

__all__ = [
    "ArrayGeometry",
    "LocateResult",
    "SourceEstimate",
    "find_channel_faults",
    "load_geometry",
    "locate",
    "locate_text",
]
