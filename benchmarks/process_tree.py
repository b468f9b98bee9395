"""Memory and processor time of a process with all that it has started."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2.0**20


class TreeUsage(NamedTuple):
    """What a process and its descendants use."""

    resident_mb: float
    """Sum of their resident memory; pages that they share count for each."""
    processor_s: float
    """Processor time of those that are there, and that these have waited for."""


def tree_usage(root: int) -> TreeUsage:
    """Usage of a process and its descendants, from /proc."""
    children: dict[int, list[int]] = {}
    usage: dict[int, TreeUsage] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        process = int(path.parent.name)
        children.setdefault(int(fields[1]), []).append(process)
        ticks = sum(map(int, fields[11:15]))
        usage[process] = TreeUsage(int(fields[21]) * _PAGE_MB, ticks * _TICK_S)
    family = [root]
    for process in family:
        family += children.get(process, [])
    members = [usage[process] for process in family if process in usage]
    return TreeUsage(*map(sum, zip(*members, strict=True)))
