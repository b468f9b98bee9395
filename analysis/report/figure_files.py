"""Writes figures as vector files and pictures, for papers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from analysis.report.file_names import distinct_names

#: Endings of the files of a figure.
FIGURE_FORMATS = ("pdf", "svg", "png")


def write_figures(figures: Mapping[str, Figure], directory: Path) -> list[Path]:
    """Writes figures in all formats.

    Args:
        figures: Figures by name. Characters that file names cannot have are replaced.
        directory: Directory, which is created if it does not exist.

    Returns:
        Paths of the files.
    """
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    names = distinct_names(figures, endings=[f".{each}" for each in FIGURE_FORMATS])
    for name, figure in zip(names, figures.values(), strict=True):
        for ending in FIGURE_FORMATS:
            path = directory / f"{name}.{ending}"
            # Letters stay letters, so that programs can search and change them.
            with mpl.rc_context({"svg.fonttype": "none", "pdf.fonttype": 42}):
                figure.savefig(path, dpi=200)
            paths.append(path)
    return paths
