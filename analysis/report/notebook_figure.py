"""A figure that a notebook displays without further commands."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

#: Resolution in a notebook, dots per inch.
_DPI = 100


class NotebookFigure(Figure):
    """A matplotlib figure that a notebook shows as the last value of a cell.

    Notebooks show figures of pyplot in the same way. But pyplot keeps all figures in
    memory and chooses a window system. A figure of this class can be deleted like any
    other object.
    """

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        self.savefig(picture, format="png", dpi=_DPI)
        return picture.getvalue()
