"""A run seen from above as a film, with what its microphones heard."""

from analysis.movies.encoding import MovieFile
from analysis.movies.run_frames import RunFrames

__all__ = ["MovieFile", "RunFrames"]
