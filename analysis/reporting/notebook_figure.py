"""A figure that a notebook shows by itself."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

#: As wide as a page is read.
_DPI = 100


class NotebookFigure(Figure):
    """As matplotlib's, and a picture where it is the last value of a cell.

    Notebooks show figures of pyplot, which keeps every one of them and chooses a
    window; ours belong to whoever asked for them.
    """

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        self.savefig(picture, format="png", dpi=_DPI)
        return picture.getvalue()
