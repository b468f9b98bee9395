"""Options of a sweep: where its results go, and which processes do the runs."""

from __future__ import annotations

from pathlib import Path

from analysis.report.result_directory import check_directory
from systems.framework.input_error import InputError

#: Greatest number of processes. Each process needs about 300 MB of memory.
MOST_WORKERS = 256


def check_options(
    out: str | Path | None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
) -> None:
    """Raises InputError if an option is not valid or contradicts another option."""
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise InputError("workers", f"{workers} must lie between 1 and {MOST_WORKERS}")
    if scheduler is not None and workers is not None:
        raise InputError(
            "workers", "a cluster has its own workers; leave out --workers"
        )
    if resume and out is None:
        raise InputError("out", "--resume needs the directory to go on with; name it")
    if out is None:
        return
    directory = Path(out).expanduser()
    begun = directory.is_dir() and any(directory.iterdir())
    if not (resume and begun):
        check_directory(directory)
