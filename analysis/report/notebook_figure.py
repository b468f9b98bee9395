"""A figure that a notebook displays without further commands."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

#: Resolution in a notebook, dots per inch.
_DPI = 100


class NotebookFigure(Figure):
    """A matplotlib figure that a notebook shows as the last value of a cell.

    Notebooks also show figures of pyplot in this way. But pyplot keeps all figures in
    memory, and loads a window system. Figures of this class need no window system, and
    are freed like any other object.
    """

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        self.savefig(picture, format="png", dpi=_DPI)
        return picture.getvalue()
