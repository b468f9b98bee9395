"""Sounds in recordings of arrays that people have."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.recordings.array_geometry import ArrayGeometry, load_geometry
    from analysis.recordings.channel_faults import find_channel_faults
    from analysis.recordings.locate import locate
    from analysis.recordings.locate_result import LocateResult, SourceEstimate
    from analysis.recordings.locate_text import locate_text
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = [
    "ArrayGeometry",
    "LocateResult",
    "SourceEstimate",
    "find_channel_faults",
    "load_geometry",
    "locate",
    "locate_text",
]
