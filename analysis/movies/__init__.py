"""A run seen from above as a film, with what its microphones heard."""

from typing import TYPE_CHECKING

from systems.framework.lazy import lazy_exports

if TYPE_CHECKING:
    from analysis.movies.encoding import MovieFile
    from analysis.movies.run_frames import RunFrames
else:
    __getattr__, __dir__ = lazy_exports(__name__)

__all__ = ["MovieFile", "RunFrames"]
